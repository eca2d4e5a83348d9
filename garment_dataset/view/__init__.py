"""Pictures of single frames with what was extracted from them; needs the extra ``view``."""
