"""An offline site of a workspace: what is there, how it stands and how good it is; needs the extra ``report``."""
