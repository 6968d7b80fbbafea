"""`hmtb dataset list`: what comes with the package."""

from scenarios.commands.output import print_json, print_table


def list_(*, json: bool = False) -> int:
    """List the data sets that come with the package.

    Args:
        json: Print JSON.
    """
    from scenarios.datasets.plan import DataSetPlan
    from scenarios.datasets.spec import shipped

    plans = {label: DataSetPlan(spec) for label, spec in shipped().items()}
    if json:
        print_json(
            {
                "data_sets": [
                    {"label": label, "title": plan.spec.title, "experiments": len(plan), "seconds": plan.seconds}
                    for label, plan in plans.items()
                ]
            }
        )
        return 0
    rows = [(label, str(len(p)), f"{p.seconds / 3600:.3g} h", p.spec.title) for label, p in plans.items()]
    print_table("data sets", ("name", "experiments", "length", "what it is"), rows)
    return 0
