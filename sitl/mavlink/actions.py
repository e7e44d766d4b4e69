"""What each MAV_CMD does: one table of the handlers, each of which gets the command in one form and answers it."""

from sitl.mavlink import failure_commands, guided_commands, mode_commands, system_commands
from sitl.mavlink.command import Entry

TABLE: dict[int, Entry] = {
    **mode_commands.COMMANDS,
    **guided_commands.COMMANDS,
    **system_commands.COMMANDS,
    **failure_commands.COMMANDS,
}
"""By MAV_CMD."""
