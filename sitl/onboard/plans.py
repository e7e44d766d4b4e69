"""The three stored plans, the places they speak of, and the fence as it is kept to."""

from sitl.geodesy import GeoPoint
from sitl.onboard.events import EventLog
from sitl.onboard.fence import Fence
from sitl.onboard.geofence import Geofence
from sitl.onboard.mission import Mission
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places
from sitl.onboard.rally import Rally
from sitl.onboard.store import Store


class Plans:
    def __init__(self, parameters: Parameters, store: Store, events: EventLog, origin: GeoPoint) -> None:
        self.places = Places(origin)
        self.mission = Mission(store, events)
        self.fence = Fence(store, events, self.places)
        self.rally = Rally(store, events)
        self.geofence = Geofence(parameters, self.fence, self.places)
