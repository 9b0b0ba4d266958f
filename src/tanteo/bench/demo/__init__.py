"""Provide ``tanteo demo``: an image leaves two parts possible, a beam discriminates them, others locate the part."""
