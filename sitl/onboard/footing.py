"""How the vehicle stands to the ground from one tick to the next: what `ground` works out, kept and told."""

from sitl.control.guidance import Effort
from sitl.onboard import ground
from sitl.onboard.calm import Ground
from sitl.onboard.events import EventLog
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.modes import EventKind, Landed, Severity
from sitl.onboard.touch import NEAR_GROUND_M


class Footing:
    """Keeps the guide's `standing` in step."""

    def __init__(self, guide: Guide, events: EventLog) -> None:
        self._guide, self._events = guide, events
        self._contact = ground.Contact(Effort.OFF, Landed.ON_GROUND)
        self._tilt = ground.Tilt()

    @property
    def effort(self) -> Effort:
        return self._contact.effort

    @property
    def standing(self) -> bool:
        """On the ground with motors idling or off."""
        return self._contact.standing

    @property
    def landed(self) -> Landed:
        return self._contact.landed

    @property
    def tipped_over(self) -> bool:
        return self._tilt.tipped_over

    def restart(self) -> None:
        """As after power-on."""
        self._contact = ground.Contact(Effort.OFF, Landed.ON_GROUND)
        self._tilt = ground.Tilt()
        self._guide.standing = True

    def standing_s(self, now_us: int) -> float:
        """How long it has stood with idling motors."""
        return self._contact.standing_s(now_us)

    def stand_anew(self) -> None:
        """Count the time of standing from now on."""
        if self.standing:
            self._contact = self._contact._replace(down_since_us=None)

    def run(self, feet_down: int) -> None:
        """Motors start: idling on the ground, flying in the air."""
        self._now_in(ground.Contact(Effort.IDLE if feet_down > 0 else Effort.FLY, self.landed))

    def stop(self, feet_down: int) -> None:
        """Motors off."""
        on_ground = feet_down > 0 or self.tipped_over
        self._now_in(ground.Contact(Effort.OFF, Landed.ON_GROUND if on_ground else self.landed))

    def rest(self, feet_down: int) -> None:
        """With motors off: whether it has come down."""
        if self.landed is not Landed.ON_GROUND and (feet_down > 0 or self.tipped_over):
            self._now_in(self._contact._replace(landed=Landed.ON_GROUND))

    def watch(self, fix: Fix, intent: ground.Intent) -> bool:
        """With motors running: decide between idling on the ground and flying. True if it has just come to stand."""
        high = fix.nav.down_m < -NEAR_GROUND_M and not fix.feet_down
        if high and self.landed is Landed.IN_AIR and intent.flying_is is Landed.IN_AIR:
            return False  # nothing that the reference could change
        stood = self.standing
        self._now_in(ground.contact(self._contact, fix, self._guide.reference(fix), intent))
        return self.standing and not stood

    def waits(self, armed: bool, intent: ground.Intent) -> Ground | None:
        """What of the reference `watch` waits for; None: it may change something at the very next tick."""
        c = self._contact
        if self._tilt != ground.Tilt():
            return None
        if not armed:
            return Ground.NOTHING if c.landed is Landed.ON_GROUND else None
        if not c.standing:
            settled = c == ground.Contact(Effort.FLY, intent.flying_is) and intent.lifting is None
            return Ground.RESTING if settled else None
        if c.down_since_us is None or intent.lifting is not None:
            return None
        return Ground.NOTHING if intent.landing else Ground.RISING

    def watch_tilt(self, fix: Fix) -> bool:
        """True if the vehicle has just been found lying on the ground."""
        before = self.tipped_over
        self._tilt = ground.tilt(self._tilt, fix.now_us, fix.nav, fix.feet_down)
        return self.tipped_over and not before

    def _now_in(self, contact: ground.Contact) -> None:
        landed, self._contact = self.landed, contact
        self._guide.standing = contact.standing
        if contact.landed is not landed:
            self._events.add(EventKind.LANDED, Severity.INFO, contact.landed.value)
