"""Robot recordings of moving cloth, turned into features that a parameter estimator can trust.

>>> from garment_dataset import Catalog, Workspace, load_features  # doctest: +SKIP
>>> Catalog.load().query(garment="GreenTowel", axis="R")  # doctest: +SKIP
>>> Workspace.find().build("garment=GreenTowel")  # doctest: +SKIP
>>> load_features("kinematics", garment="GreenTowel", point=[1, 5])  # doctest: +SKIP
"""

from garment_dataset.catalog import Catalog
from garment_dataset.features import load_features, open_features
from garment_dataset.workspace import Workspace

__all__ = ["Catalog", "Workspace", "load_features", "open_features"]
