"""Compute constraints between features with their variances (section 4 of the paper) and test them (section 5).

``relate`` and ``relate_all`` compute the constraints of features. The functions named after a constraint are the
underlying array functions, over batches of frames and covariances. ``published`` has the paper's formulas as printed.
"""
