"""What a good recording is: the contract, as ``catalog/contract.toml`` writes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, NonNegativeFloat, PositiveFloat, ValidationError

from garment_dataset.errors import CatalogError
from garment_dataset.files import first_fault, read_toml
from garment_dataset.layout import packaged_workspace

if TYPE_CHECKING:
    from pathlib import Path

CONTRACT = "contract.toml"
"""Its file, in the folder of the catalog."""

Stream = Literal["depth", "color"]


def _in_order(bounds: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= bounds[0] <= bounds[1]:
        raise ValueError("two numbers, the smaller first, none below zero")
    return bounds


def _topic_name(name: str) -> str:
    if not name.startswith("/"):
        raise ValueError("the full name of a topic, which begins with /")
    return name


def _message_type(name: str) -> str:
    """Return a type as rosbags writes it; ROS 1 leaves out ``msg``."""
    parts = name.split("/")
    if len(parts) not in {2, 3} or not all(parts):
        raise ValueError("the name of a message type, such as sensor_msgs/msg/Image")
    return f"{parts[0]}/msg/{parts[-1]}"


Bounds = Annotated[tuple[float, float], AfterValidator(_in_order)]
Share = Annotated[float, Field(ge=0, le=1)]
TopicName = Annotated[str, AfterValidator(_topic_name)]
MessageType = Annotated[str, AfterValidator(_message_type)]


class _Rule(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RecordingRule(_Rule):
    """The table ``[recording]``: a bag as a whole."""

    duration_s: Bounds = (3.0, 20.0)
    max_late_s: PositiveFloat = 1.0
    max_stamp_offset_s: PositiveFloat = 1.0


class TopicRule(_Rule):
    """A table ``[topics."/NAME"]``; what it does not say is not checked."""

    types: tuple[MessageType, ...] = ()
    required: bool = True
    rate_hz: Bounds | None = None
    max_gap_s: PositiveFloat | None = None


class StreamRule(_Rule):
    """What the images of either camera have in common."""

    topic: TopicName
    camera_info_topic: TopicName
    encodings: tuple[str, ...] = ()
    sizes_px: tuple[tuple[int, int], ...] = ()
    max_frozen_s: PositiveFloat = 2.0


class DepthRule(StreamRule):
    """The table ``[images.depth]``."""

    least_valid: Share = 0.05


class ColorRule(StreamRule):
    """The table ``[images.color]``."""

    least_contrast: NonNegativeFloat = 3.0


class ImagesRule(_Rule):
    """The table ``[images]``; a stream that it leaves out is not looked at."""

    depth: DepthRule | None = None
    color: ColorRule | None = None


class GripperRule(_Rule):
    """The table ``[gripper]``: its end point, as the depth camera sees it."""

    topic: TopicName = "/r2_ee_to_depth"
    frame: str = "r2_ee"
    camera_frame: str = ""
    least_known: Share = 0.9
    least_in_view: Share = 0.9
    least_travel_m: NonNegativeFloat = 0.02
    max_speed_m_s: PositiveFloat = 5.0


class BackgroundRule(_Rule):
    """The table ``[background]``: which recordings need a bag of the empty scene."""

    axes: tuple[Literal["R", "B"], ...] = ("B",)


class Contract(_Rule):
    """All of it; a table that is left out is not checked.

    Parameters
    ----------
    recording, topics, images, gripper, background
        See the classes of these rules, and the comments in the file that the package brings.
    """

    recording: RecordingRule = RecordingRule()
    topics: dict[TopicName, TopicRule] = Field(default_factory=dict)
    images: ImagesRule = ImagesRule()
    gripper: GripperRule | None = None
    background: BackgroundRule = BackgroundRule(axes=())

    @property
    def streams(self) -> dict[Stream, DepthRule | ColorRule]:
        """The image streams that it speaks of."""
        both: dict[Stream, DepthRule | ColorRule | None] = {"depth": self.images.depth, "color": self.images.color}
        return {stream: rule for stream, rule in both.items() if rule is not None}

    def of_empty_scene(self) -> Contract:
        """Return what holds for a bag of the empty scene: its colour images; no gripper is looked for there."""
        color = self.images.color
        needed = set() if color is None else {color.topic, color.camera_info_topic}
        topics = {
            name: rule.model_copy(update={"required": rule.required and name in needed})
            for name, rule in self.topics.items()
        }
        recording = self.recording.model_copy(update={"duration_s": (0.0, self.recording.duration_s[1])})
        update = {"recording": recording, "topics": topics, "images": ImagesRule(color=color)}
        return self.model_copy(update={**update, "gripper": None, "background": BackgroundRule(axes=())})


def contract_of(catalog_dir: Path) -> Contract:
    """Read the contract of a catalog; of one without, that of the package.

    Raises
    ------
    CatalogError
        See :func:`read_contract`.
    """
    own = catalog_dir / CONTRACT
    return read_contract(own if own.exists() else packaged_workspace() / "catalog" / CONTRACT)


def read_contract(path: Path) -> Contract:
    """Read a contract.

    Raises
    ------
    CatalogError
        If it cannot be read, or an entry is not understood: which, what it may be, and what may be meant.
    """
    try:
        return Contract.model_validate(read_toml(path))
    except ValidationError as error:
        entry, expected, found, hint = first_fault(error, Contract)
        what = f"entry {entry!r} is not understood"
        raise CatalogError(what, where=path, expected=expected, found=found, hint=hint) from error
    except OSError as error:
        hint = "`garment check --init GOOD.bag` learns one from good recordings."
        raise CatalogError("cannot be read", where=path, found=error.strerror or error, hint=hint) from error
    except ValueError as error:
        raise CatalogError("not TOML", where=path, found=error) from error
