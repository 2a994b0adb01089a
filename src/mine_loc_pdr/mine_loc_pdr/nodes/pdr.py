"""Node: steps and odometry of all people who wear an N100."""

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TransformStamped, Vector3
from mine_loc_interfaces.msg import Activity as ActivityMessage
from mine_loc_interfaces.msg import LandmarkFix, Step, StrideUpdate, UwbPose
from mine_loc_interfaces.msg import VelocityChange as VelocityChangeMessage
from mine_loc_interfaces.srv import Reset, SetPose
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, MagneticField
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from mine_loc_core import quaternion
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED, STREAM
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.people import N100, PeopleFile, Person
from mine_loc_core.site import Site, load_site
from mine_loc_core.stamps import NS_PER_S, to_stamp_ns
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_pdr.activity import Activity, ActivityModel, ActivityRecogniser
from mine_loc_pdr.activity_model_file import load_model, shipped_model
from mine_loc_pdr.dead_reckoning import ImuSample, OdometryPose, PedestrianDeadReckoning, StepEvent
from mine_loc_pdr.gallery_constraint import GalleryConstraint
from mine_loc_pdr.nodes.landmark_messages import to_landmark_fix, to_map_pose
from mine_loc_pdr.parameters import PdrParameters
from mine_loc_pdr.plane_follower import PlaneFollower
from mine_loc_pdr.pseudo_plane import PseudoPlane
from mine_loc_pdr.sensor_cdr import field_sample, imu_sample
from mine_loc_pdr.step_detector import NetworkStepDetector, StepModel
from mine_loc_pdr.step_model_file import load_step_model, shipped_step_model
from mine_loc_pdr.steps import PeakStepDetector, StepDetector
from mine_loc_pdr.stride import stride_model
from mine_loc_pdr.stride_refinement import Fix, StrideRefiner, StrideScale
from mine_loc_pdr.velocity_changes import VelocityChange

_PEOPLE_PERIOD_S = 1.0
_MOUNTING_PERIOD_S = 1.0
_MOUNTING_MOVED_RAD = math.radians(5.0)  # a transform said to be static is not sent anew for less
_WRONG_FRONT_RAD = math.radians(30.0)
_SILENT_S = 1.0
_FLAT_VARIANCE = 1e6  # z, roll and pitch: dead reckoning on the plane says nothing about them


@dataclass(frozen=True, slots=True)
class Models:
    """What all tracks share: how to recognise activities and steps, these by paper B where `steps` is None."""

    activities: ActivityModel
    steps: StepModel | None

    def step_detector(self) -> StepDetector:
        """A detector for one track."""
        return PeakStepDetector() if self.steps is None else NetworkStepDetector(self.steps)


class Track:
    """One person's dead reckoning and the ends of its topics."""

    def __init__(self, person: Person, n100: N100, models: Models, site: Site, heard_ns: int) -> None:
        self.person = person
        self._n100 = n100
        self.entities: list[Any] = []  # what is released with the track
        self._models = models
        self._site = site
        self.odometry: Any = None
        self.heard_ns = heard_ns
        self.field_heard_ns: int | None = None
        self.faults_reported = 0
        self.restart()

    def restart(self) -> None:
        """Begin at the origin of odom."""
        mounting = quaternion.from_euler_zyx(*self._n100.mounting_rpy_rad)
        x, y, z = quaternion.rotate(quaternion.conjugate(mounting), (1.0, 0.0, 0.0))
        stride = stride_model(self.person)
        self.pdr = PedestrianDeadReckoning(stride, (float(x), float(y), float(z)), self._models.step_detector())
        self.refiner = StrideRefiner(stride.scale, stride.scale_variance)
        self._recogniser = ActivityRecogniser(self._models.activities)
        area = WalkableArea.of(self._site)
        self.plane = PlaneFollower(
            PseudoPlane(self._site.turn_markers), None if area is None else GalleryConstraint(area)
        )
        self.published_period = 0
        self.mounting_yaw_rad: float | None = None  # as last published
        self.samples = self.changes = 0

    def recognise(self, sample: ImuSample, heading_rad: float) -> Activity | None:
        """The activity of the window that ends with a sample, and the waist's heading after it."""
        return self._recogniser.push(sample.stamp_ns, heading_rad, sample.force_m_s2)


class Pdr(NodeBase):
    """Publishes pdr/steps, activity, landmark_fix and stride_updates, each <person>/odometry and its transforms."""

    default_name = "pdr"
    parameter_class = PdrParameters

    def configure(self) -> None:
        """Read the people and listen to each who wears an N100."""
        self._tracks: dict[str, Track] = {}
        self._site = load_site(Path(self.parameters.site))
        self._file = PeopleFile(Path(self.parameters.site))
        self._models = Models(self._activity_model(), self._step_model())
        self._activities = self.publish_to(ActivityMessage, "pdr/activity", EVENTS)
        self._steps = self.publish_to(Step, "pdr/steps", EVENTS)
        self._changes = self.publish_to(VelocityChangeMessage, "pdr/velocity_changes", EVENTS)
        self._strides = self.publish_to(StrideUpdate, "pdr/stride_updates", EVENTS)
        self.subscribe(UwbPose, "uwb/pose", self._on_uwb_pose, EVENTS)
        self._landmark_fixes = self.publish_to(LandmarkFix, "pdr/landmark_fix", EVENTS)
        self._tf = self.publish_to(TFMessage, "/tf", EVENTS)
        self._tf_static = self.publish_to(TFMessage, "/tf_static", LATCHED)
        self._follow(self._file.people)
        self.parameters_changed()
        self.every(_PEOPLE_PERIOD_S, self._poll_people)
        self.every(_MOUNTING_PERIOD_S, self._publish_mountings)
        self.serve(Reset, "~/reset", self._reset)
        self.serve(SetPose, "~/set_pose", self._set_pose)

    def _activity_model(self) -> ActivityModel:
        file = self.parameters.activity_model
        return load_model(Path(file) if file else shipped_model())[0]

    def _step_model(self) -> StepModel | None:
        file = self.parameters.step_model
        if self.parameters.step_detector == "peaks":
            return None
        return load_step_model(Path(file) if file else shipped_step_model())[0]

    def parameters_changed(self) -> None:
        """Work out the period of the odometry."""
        self._period_ns = round(NS_PER_S / self.parameters.odometry_rate)

    def health(self) -> Iterable[Health]:
        """Each person's track, and the people file."""
        yield from (self._track_health(track) for track in self._tracks.values())
        if self._file.error:
            yield Health("people file", Level.WARN, self._file.error)

    def _poll_people(self) -> None:
        people = self._file.poll()
        if people is not None:
            self._follow(people)

    def _follow(self, people: Iterable[Person]) -> None:
        """Listen to these people; a track whose person did not change goes on."""
        wearers = {person.name: person for person in people if person.n100}
        for name, track in list(self._tracks.items()):
            if wearers.get(name) != track.person:
                self.release(*track.entities)
                del self._tracks[name]
        for name, person in wearers.items():
            if name not in self._tracks and person.n100:
                self._tracks[name] = self._new_track(person, person.n100)

    def _new_track(self, person: Person, n100: N100) -> Track:
        track = Track(person, n100, self._models, self._site, self.steady_ns())
        track.odometry = self.publish_to(Odometry, f"/{person.name}/odometry", EVENTS)
        name = f"/{person.name}/imu"
        imu = self.subscribe(Imu, f"{name}/data", lambda message: self._on_imu(track, message), STREAM, raw=True)
        mag = self.subscribe(
            MagneticField, f"{name}/mag", lambda message: self._on_field(track, message), STREAM, raw=True
        )
        track.entities = [track.odometry, imu, mag]
        return track

    def _on_imu(self, track: Track, message: bytes) -> None:
        sample = imu_sample(message)
        steps = track.pdr.push(sample)
        track.samples += 1
        track.heard_ns = self.steady_ns()
        for step in steps:
            self._steps.publish(_step(track.person.name, step))
            self._refine_stride(track, step)
        if (change := track.pdr.velocity_change) is not None:
            track.changes += 1
            self._changes.publish(_velocity_change(track, change))
        if (heading_rad := track.pdr.heading_rad) is not None:
            self._follow_heading(track, sample, heading_rad, steps)
        period = sample.stamp_ns // self._period_ns
        if period != track.published_period and (pose := track.pdr.pose()) is not None:
            track.published_period = period
            self._publish_pose(track, pose)

    def _refine_stride(self, track: Track, step: StepEvent) -> None:
        first = step.interval_s is None
        found = track.refiner.step(step.stamp_ns, complex(step.x_m, step.y_m), first=first)
        if found is not None:
            track.pdr.rescale(found.scale, found.variance)
            self._strides.publish(_stride_update(track.person, step.stamp_ns, found))

    def _on_uwb_pose(self, message: UwbPose) -> None:
        person = self._file.people.by_tag(message.tag_id)
        track = None if person is None else self._tracks.get(person.name)
        if track is None or message.status != UwbPose.OK or "/" in message.header.frame_id:  # of a vehicle's own frame
            return
        place, covariance = message.pose.pose.position, message.pose.covariance
        variance_m2 = float(max(covariance[0], covariance[7]))
        track.refiner.fix(Fix(to_stamp_ns(message.header.stamp), complex(place.x, place.y), variance_m2))

    def _on_field(self, track: Track, message: bytes) -> None:
        track.pdr.push_field(field_sample(message))
        track.field_heard_ns = self.steady_ns()

    def _follow_heading(self, track: Track, sample: ImuSample, heading_rad: float, steps: Sequence[StepEvent]) -> None:
        if (activity := track.recognise(sample, heading_rad)) is not None:
            self._activities.publish(_activity(track.person.name, activity))
        if (fix := track.plane.push(sample.stamp_ns, heading_rad, steps)) is not None:
            self._landmark_fixes.publish(to_landmark_fix(fix, track.person.name, self._site.map_frame))

    def _publish_pose(self, track: Track, pose: OdometryPose) -> None:
        followed = self._tf.get_subscription_count()
        if not (followed or track.odometry.get_subscription_count()):
            return
        name = track.person.name
        odometry = Odometry(child_frame_id=f"{name}/base_link")
        odometry.header = Header(stamp=to_time(pose.stamp_ns), frame_id=f"{name}/odom")
        body = odometry.pose.pose
        body.position.x, body.position.y = pose.x_m, pose.y_m
        body.orientation.w, body.orientation.z = math.cos(0.5 * pose.yaw_rad), math.sin(0.5 * pose.yaw_rad)
        odometry.pose.covariance = _covariance(pose)
        odometry.twist.covariance[::7] = _FLAT_VARIANCE
        track.odometry.publish(odometry)
        if not followed:
            return
        transform = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
        transform.transform.translation.x, transform.transform.translation.y = pose.x_m, pose.y_m
        transform.transform.rotation = body.orientation
        self._tf.publish(TFMessage(transforms=[transform]))

    def _publish_mountings(self) -> None:
        """Where the sensors sit, all in one message, since the last one is all that a latecomer gets."""
        found = {name: yaw for name, track in self._tracks.items() if (yaw := self._mounting_yaw(track)) is not None}
        moved = [name for name, yaw in found.items() if _differs(yaw, self._tracks[name].mounting_yaw_rad)]
        if not moved:
            return
        for name in moved:
            self._tracks[name].mounting_yaw_rad = found[name]
        tracks = [track for track in self._tracks.values() if track.mounting_yaw_rad is not None]
        self._tf_static.publish(TFMessage(transforms=[self._mounting(track) for track in tracks]))

    def _mounting_yaw(self, track: Track) -> float | None:
        """Yaw of the front beside the supposed one; None while it is not known."""
        if self.parameters.mounting == "stated":
            return None if track.pdr.pose() is None else 0.0
        return front.yaw_rad if (front := track.pdr.front) else None

    def _mounting(self, track: Track) -> TransformStamped:
        name = track.person.name
        transform = TransformStamped(child_frame_id=f"{name}/imu_link")
        transform.header = Header(stamp=to_time(self.now_ns()), frame_id=f"{name}/base_link")
        q = transform.transform.rotation
        q.w, q.x, q.y, q.z = track.pdr.mounting(track.mounting_yaw_rad)
        return transform

    def _reset(self, request: Any) -> tuple[bool, str]:
        if request.person and request.person not in self._tracks:
            return False, f"{request.person}: wears no N100; known: {', '.join(self._tracks) or 'nobody'}"
        chosen = [request.person] if request.person else list(self._tracks)
        for name in chosen:
            self._tracks[name].restart()
        return True, f"restarted: {', '.join(chosen) or 'nobody'}"

    def _set_pose(self, request: Any) -> tuple[bool, str]:
        track = self._tracks.get(request.person)
        if track is None:
            return False, f"{request.person!r}: wears no N100; known: {', '.join(self._tracks) or 'nobody'}"
        pose = to_map_pose(request.pose, self._site.map_frame)
        refusal = track.plane.set_pose(pose, track.refiner.known.variance, track.pdr.bias_sd_rad_s)
        if refusal is not None:
            return False, f"{request.person}: {refusal}"
        return True, f"{request.person} is followed from there"

    def _hears_field(self, track: Track) -> bool:
        heard_ns = track.field_heard_ns
        return heard_ns is not None and self.steady_ns() - heard_ns < _SILENT_S * NS_PER_S

    def _track_health(self, track: Track) -> Health:
        name, pdr, silent_s = track.person.name, track.pdr, (self.steady_ns() - track.heard_ns) / NS_PER_S
        faults = sum(pdr.faults.values())
        new_faults, track.faults_reported = faults - track.faults_reported, faults
        values = {"samples": track.samples, "steps": pdr.step_count, **pdr.faults}
        values["magnetometer"] = "heard" if self._hears_field(track) else "absent"
        values["stride_k"] = f"{track.refiner.known.scale:.3f} ± {math.sqrt(track.refiner.known.variance):.3f}"
        values |= {f"stretches_{verdict}": count for verdict, count in track.refiner.verdicts.items()}
        values |= {f"field_{verdict}": count for verdict, count in pdr.magnetic.verdicts.items()}
        pose = pdr.pose()
        if pose is not None:
            values["heading_sd_deg"] = f"{math.degrees(math.sqrt(pose.covariance[2, 2])):.1f}"
            values["gyro_bias_sd_deg_s"] = f"{math.degrees(pdr.bias_sd_rad_s):.3f}"
        front = pdr.front
        if front is not None:
            values["front_yaw_deg"] = f"{math.degrees(front.yaw_rad):.0f}"
            values["front_yaw_sd_deg"] = f"{math.degrees(math.sqrt(front.variance_rad2)):.0f}"
        values |= {f"landmark_{name}": count for name, count in track.plane.counts.items()}
        if silent_s > _SILENT_S:
            return Health(name, Level.ERROR, f"no samples for {silent_s:.1f} s", values)
        if new_faults:
            return Health(name, Level.WARN, f"{new_faults} unusable samples or gaps in the last second", values)
        if self.parameters.mounting == "stated" and front is not None and abs(front.yaw_rad) > _WRONG_FRONT_RAD:
            beside = f"walks {math.degrees(front.yaw_rad):.0f}° beside the front that mounting_rpy_deg states"
            return Health(name, Level.WARN, beside, values)
        return Health(name, Level.OK, "tracking" if pose is not None else "finding the horizon", values)


def _step(person: str, step: StepEvent) -> Step:
    return Step(
        header=Header(stamp=to_time(step.stamp_ns), frame_id=f"{person}/odom"),
        person=person,
        count=step.count,
        interval=math.nan if step.interval_s is None else step.interval_s,
        length=step.length_m,
        length_variance=step.length_variance_m2,
        heading=step.heading_rad,
        heading_variance=step.heading_variance_rad2,
        position=to_point((step.x_m, step.y_m, 0.0)),
        confidence=step.confidence,
    )


def _velocity_change(track: Track, change: VelocityChange) -> VelocityChangeMessage:
    x, y, z = change.change_m_s
    return VelocityChangeMessage(
        header=Header(stamp=to_time(change.stamp_ns), frame_id=f"{track.person.name}/odom"),
        person=track.person.name,
        count=track.changes,
        interval=change.interval_s,
        change=Vector3(x=x, y=y, z=z),
    )


def _stride_update(person: Person, stamp_ns: int, found: StrideScale) -> StrideUpdate:
    return StrideUpdate(
        header=Header(stamp=to_time(stamp_ns), frame_id=f"{person.name}/odom"),
        person=person.name,
        k=found.scale,
        k_variance=found.variance,
        alpha=person.stride.alpha,
        beta=person.stride.beta,
        steps_used=found.steps_used,
    )


def _differs(yaw_rad: float, published_rad: float | None) -> bool:
    return published_rad is None or abs(math.remainder(yaw_rad - published_rad, math.tau)) > _MOUNTING_MOVED_RAD


def _activity(person: str, activity: Activity) -> ActivityMessage:
    return ActivityMessage(
        header=Header(stamp=to_time(activity.stamp_ns), frame_id=f"{person}/odom"),
        person=person,
        activity=int(activity.kind),
        probability=activity.probability,
        window=activity.window_s,
        turn_angle=activity.turn_rad,
    )


def _covariance(pose: OdometryPose) -> list[float]:
    """Row-major 6×6 of x, y, z, roll, pitch, yaw."""
    p = pose.covariance.tolist()
    full = [0.0] * 36
    full[0], full[1], full[5] = p[0]
    full[6], full[7], full[11] = p[1]
    full[30], full[31], full[35] = p[2]
    full[14] = full[21] = full[28] = _FLAT_VARIANCE
    return full


def main() -> int:
    """Entry point."""
    return run(Pdr)


if __name__ == "__main__":
    sys.exit(main())
