"""Studies that differ from the small one in one thing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from hmtb_twin import STUDIED_JOINTS


def with_log(study, name, log):
    """Return the study with another record of its main campaign."""
    main = replace(study.campaign, logs={**study.campaign.logs, name: log})
    return replace(study, campaigns=(main, *study.campaigns[1:]))


def without_log(study, name, why=""):
    """Return the study without a record of its main campaign, which failed for a reason."""
    logs = {key: log for key, log in study.campaign.logs.items() if key != name}
    main = replace(study.campaign, logs=logs, failed={name: why} if why else {})
    return replace(study, campaigns=(main, *study.campaigns[1:]))


def with_models(study, models):
    """Return the study with other models of three joints."""
    return replace(study, multivariable=replace(study.multivariable, models=tuple(models)))


def with_model(study, name, **fields):
    """Return the study with other fields of its identified model of three joints of a name, such as OKID."""
    return with_models(
        study,
        [replace(entry, **fields) if entry.name == f"{name} model" else entry for entry in study.multivariable.models],
    )


def with_joints(study, change, joints=STUDIED_JOINTS):
    """Return the study with other results of joints: `change` makes fields of a result from the result."""
    changed = {joint: replace(study.joints[joint], **change(study.joints[joint])) for joint in joints}
    return replace(study, joints={**study.joints, **changed})


def with_model_of_joints(study, method, change, joints=STUDIED_JOINTS):
    """Return the study with other fields of a method's model of joints, which `change` makes from the model."""

    def models(result):
        model = result.models[method]
        return {"models": {**result.models, method: replace(model, **change(model))}}

    return with_joints(study, models, joints)


def with_nonparametric(study, change):
    """Return the study with other fields of the nonparametric estimates, made from them and the name of the joint."""
    changed = {
        joint: replace(estimates, **change(joint, estimates)) for joint, estimates in study.nonparametric.items()
    }
    return replace(study, nonparametric=changed)


def whiteness(p):
    """Change a model's test of residuals to one with this p-value of whiteness."""
    return lambda model: {"residual_test": replace(model.residual_test, whiteness_p=np.array([p]))}


def estimated(model):
    """An estimate of which the model alone is looked at."""
    return SimpleNamespace(model=model)


def gained(model, factor):
    """The model with every gain times a factor."""
    return replace(model, C=factor * model.C, D=factor * model.D)
