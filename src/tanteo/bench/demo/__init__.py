"""The story of ``tanteo demo``: an image leaves two parts, a beam discriminates them, a few more place it."""
