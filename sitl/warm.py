"""Compile every kernel into the cache, so that the first flight starts at once: `python -m sitl.warm`."""

from sitl.vehicle import Vehicle, load_vehicle


def main() -> None:
    vehicle = Vehicle(load_vehicle("yawsitter"))
    vehicle.advance(20_000)
    vehicle.commander.takeoff()
    vehicle.commander.arm()
    vehicle.advance(40_000)
    vehicle.snapshot()
    vehicle.loads()


if __name__ == "__main__":
    main()
