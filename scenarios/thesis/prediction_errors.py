"""Prediction errors of chapter IV: other data sets, other orders, no friction."""

from collections.abc import Mapping
from dataclasses import dataclass

from scenarios.experiments.campaign import Campaign, single_joint_test
from scenarios.experiments.model_structures import every_structure
from scenarios.thesis.every_data_set import DataSets, every_data_set
from scenarios.thesis.more_poles import MorePoles, more_poles
from scenarios.thesis.order_search import Searches, search_orders
from sysid import Estimate, IOData

LARGE = "shoulder_yaw"
"""The joint of which the thesis says that output-error models with more poles turn unstable."""


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """One joint beyond the models of the estimation test.

    Attributes:
        data_sets: The thesis' structures identified from every data set.
        frictionless: The same from the estimation test played on the arm without friction.
        more_poles: Output-error models with more poles, of the joint of which the thesis speaks; else nothing.
        searches: Searches for orders; None where the study is not thorough.
    """

    data_sets: DataSets
    frictionless: DataSets
    more_poles: tuple[MorePoles, ...]
    searches: Searches | None


def prediction_errors(
    joint: str,
    data: Mapping[int, IOData],
    own: int,
    known: Mapping[str, Estimate],
    main: Campaign,
    smooth: Campaign,
    *,
    thorough: bool,
) -> PredictionErrors:
    """Analyse a joint beyond the models of the estimation test.

    Args:
        joint: Name of the joint.
        data: Its prepared records by number of the test.
        own: Number of the estimation test.
        known: Estimates from that test with the thesis' orders, by method.
        main: The campaign that the study is about.
        smooth: The one without friction.
        thorough: Whether to analyse too what no finding rests on.

    Returns:
        The analyses.
    """
    test = single_joint_test(own, joint)
    asked = {entry.method: entry for entry in every_structure(joint)}
    return PredictionErrors(
        data_sets=every_data_set(
            joint, main, known={(test, method): found for method, found in known.items()}, thorough=thorough
        ),
        frictionless=every_data_set(joint, smooth),
        more_poles=more_poles(data[own], asked["oe"].orders[2]) if joint == LARGE else (),
        searches=search_orders(joint, data, own, {name: asked[name].orders for name in ("armax", "oe")})
        if thorough
        else None,
    )
