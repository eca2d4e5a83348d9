"""A self-contained copy of chosen results, in forms that other readers, catalogs of data sets and people take."""
