"""The garments of the catalog as sheets of cloth: size and mass from table 4.1, looks and stiffness by convention."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from garment_dataset.errors import GarmentError
from garment_dataset.simulate.cloth import ClothSpec
from garment_dataset.simulate.render import Fabric
from garment_dataset.simulate.scene import WALL_COLOR

if TYPE_CHECKING:
    from garment_dataset.catalog import Catalog
    from garment_dataset.simulate.nuisance_cloth import ClothNuisance

_TOWEL_ON_RULER_M = (0.36, 0.64)
"""The towel of table 4.1, 60 x 36 cm, hangs some 64 cm below the ruler (thesis chapter 6)."""

_REFERENCE_KG_M2 = 0.2
_STRETCH_N_M = 700.0
_BENDING_N_M = 6e-6

_FABRICS = {
    "BlueShirt": Fabric((52, 84, 158)),
    "FelShirt": Fabric((122, 122, 126)),
    "RedSkirt": Fabric((176, 40, 44)),
    "GreenTowel": Fabric((64, 142, 78), weave=0.10),
    "BlackShorts": Fabric((44, 44, 48)),
    "WhiteBlackShirt": Fabric((226, 224, 220), stripe_color=(38, 38, 42)),
    "RedPullover": Fabric((158, 34, 42), weave=0.12),
    "WhitePullover": Fabric((232, 228, 214), weave=0.12),
}
_COLORS = {
    "black": (44, 44, 48),
    "blue": (52, 84, 158),
    "gray": (122, 122, 126),
    "green": (64, 142, 78),
    "red": (176, 40, 44),
    "white": (232, 228, 214),
}
_UNKNOWN_COLOR = (140, 110, 80)


def cloth_of(garment: str, holding: str, catalog: Catalog) -> ClothSpec:
    """Return the sheet of a garment.

    Parameters
    ----------
    garment, holding : str
        As in the recording's name.
    catalog : Catalog
        Whose ``garments.csv`` gives size and weight.

    Raises
    ------
    GarmentError
        If the catalog does not say the garment's size and weight.
    """
    row = next((row for row in catalog.tables.garments if row.garment == garment), None)
    if row is None or row.width_cm is None or row.height_cm is None or row.weight_g is None:
        raise GarmentError(
            "no size and weight to simulate",
            where=garment,
            expected="a row of catalog/garments.csv with width_cm, height_cm and weight_g",
        )
    size_m = (float(row.width_cm) / 100, float(row.height_cm) / 100)
    if (garment, holding) == ("GreenTowel", "Ruler"):
        size_m = _TOWEL_ON_RULER_M
    return cloth_of_size(*size_m, float(row.weight_g) / 1000)


def cloth_of_size(width_m: float, height_m: float, mass_kg: float) -> ClothSpec:
    """Return a sheet of given size and mass whose stiffness grows with its mass per area, as heavier fabrics' does."""
    plain = ClothSpec(width_m, height_m, mass_kg)
    density = max(1.0, mass_kg / plain.area_m2() / _REFERENCE_KG_M2)
    return ClothSpec(width_m, height_m, mass_kg, _STRETCH_N_M * density, _BENDING_N_M * density**1.5)


def unusual(spec: ClothSpec, nuisance: ClothNuisance) -> ClothSpec:
    """Return a sheet with the nuisances of a garment; a larger sheet of one cloth is heavier."""
    wide, high = (1.0, 1.0) if nuisance.size is None else nuisance.size
    return replace(
        spec,
        width_m=spec.width_m * wide,
        height_m=spec.height_m * high,
        mass_kg=spec.mass_kg * wide * high * (1.0 if nuisance.mass is None else nuisance.mass),
        bending_n_m=spec.bending_n_m * (1.0 if nuisance.bending is None else nuisance.bending),
        stretch_n_m=spec.stretch_n_m * (1.0 if nuisance.stretch is None else nuisance.stretch),
    )


def unusual_fabric(fabric: Fabric, nuisance: ClothNuisance) -> Fabric:
    """Return a garment's looks with its nuisances; the pattern lies on the cloth whose hue is the wall's."""
    if nuisance.wall_hue is not None:
        light = sum(fabric.color) / sum(WALL_COLOR)
        red, green, blue = (
            round(own + nuisance.wall_hue * (light * of_wall - own))
            for own, of_wall in zip(fabric.color, WALL_COLOR, strict=True)
        )
        fabric = replace(fabric, color=(red, green, blue))
    if nuisance.pattern is not None:
        pattern = nuisance.pattern
        fabric = replace(fabric, stripe_color=pattern.color, stripe_m=pattern.width_m, checked=pattern.checked)
    return fabric


def fabric_of(garment: str, catalog: Catalog) -> Fabric:
    """Return how a garment looks: by its name, else by the colour that the catalog says."""
    if garment in _FABRICS:
        return _FABRICS[garment]
    color = next((row.color for row in catalog.tables.garments if row.garment == garment), None)
    return Fabric(_COLORS.get(str(color), _UNKNOWN_COLOR))
