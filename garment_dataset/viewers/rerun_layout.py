"""How Rerun arranges a recording: space and images on the left, curves on the right."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import rerun.blueprint as rrb

    from garment_dataset.viewers.content import Content, ShownCamera

_MIDDLE_FROM_GRIPPER_M = np.array([0.0, 0.3, 0.0])
_EYE_FROM_TARGET_M = np.array([0.8, -0.3, -0.9])


def blueprint(content: Content, timeline: str) -> rrb.Blueprint:
    """Return the arrangement; there is a view only of what the recording has.

    Parameters
    ----------
    content : Content
        Of the recording.
    timeline : str
        The one that is played.
    """
    import rerun.blueprint as rrb

    views, curves = _views(content), _curves(content)
    left = rrb.Vertical(views[0], rrb.Horizontal(*views[1:]), row_shares=[3, 2]) if len(views) > 1 else views[0]
    right = rrb.Vertical(*curves)
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=timeline),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def root_of(camera: ShownCamera) -> str:
    """Return the entity of a camera's optical frame; a name may have any letters in it."""
    import rerun as rr

    return rr.escape_entity_path_part(camera.frame_id)


def _views(content: Content) -> list[Any]:
    """Return a view of space, if there is depth, and one for every stream that has images."""
    import rerun.blueprint as rrb

    views: list[Any] = []
    if "depth" in content.cameras:
        root = root_of(content.cameras["depth"])
        inside = [f"+ /{root}/**", f"- /{root}/depth_image/depth_mm", f"- /{root}/color_image/**"]
        eye, name = _eye(content), f"{content.cameras['depth'].frame_id} [m]"
        views.append(rrb.Spatial3DView(origin=f"/{root}", contents=inside, name=name, eye_controls=eye))
    for stream, camera in content.cameras.items():
        inside = ["+ $origin/**", "- $origin/garment_mm"]
        if "depth" in content.cameras and (stream == "depth" or content.other_in_main is not None):
            root = root_of(content.cameras["depth"])
            inside += [f"+ /{root}/{name}" for name in ("chain_m", "points_m", "tracks_m")]
        name = f"{stream} [{'mm' if stream == 'depth' else 'px'}], {camera.frame_id}"
        origin = f"/{root_of(camera)}/{stream}_image"
        views.append(rrb.Spatial2DView(origin=origin, contents=inside, name=name))
    return views


def _eye(content: Content) -> Any:  # noqa: ANN401 - what a blueprint is made of
    """Return from where space is seen: from the right of the camera and above, so that depth shows."""
    import rerun.blueprint as rrb

    ends_m = content.tables["gripper"].query("stream == 'depth'")[["x_m", "y_m", "z_m"]].dropna()
    if ends_m.empty:
        return None
    target_m = ends_m.median().to_numpy(np.float64) + _MIDDLE_FROM_GRIPPER_M
    return rrb.EyeControls3D(position=target_m + _EYE_FROM_TARGET_M, look_target=target_m, eye_up=[0.0, -1.0, 0.0])


def _curves(content: Content) -> list[Any]:
    """Return views of curves; those of points are coloured as the points in space, and need no legend."""
    import rerun.blueprint as rrb

    wanted: dict[str, str] = {}
    if "kinematics" in content.tables:
        wanted |= {"z_m": "z of points [m], 2 std", "vz_m_s": "velocity along z [m/s], 2 std"}
    wanted["gripper_m"] = f"gripper [m], {content.cameras[content.main].frame_id}"
    if "joints" in content.tables:
        wanted["joints_rad"] = "joints [rad]"
    return [
        rrb.TimeSeriesView(
            origin=f"/{root}", name=name, plot_legend=rrb.PlotLegend(visible=root == "gripper_m", corner="RightTop")
        )
        for root, name in wanted.items()
    ]
