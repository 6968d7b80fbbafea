"""Names of all that a model may consist of, in files and messages."""

MATRICES = ("A", "B", "C", "D", "K")
"""Of the innovation form."""

POLYNOMIALS = {"poly_a": "A", "poly_b": "B", "poly_c": "C", "poly_d": "D", "poly_f": "F"}
"""Of polynomials, as files have them and as `sysid.Polynomials` has them."""

FRACTION = ("num", "den")
"""Of numerator and denominator."""

CLAIMS = ("innovation_covariance", "covariance", "response_covariance", "bandwidth_ci95")
"""Of what an estimator claims to know."""

NAMES = ("dt", *MATRICES, *POLYNOMIALS, *FRACTION, *CLAIMS)
"""All."""
