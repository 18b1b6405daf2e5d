import pytest
from pydantic import BaseModel, ValidationError

from automos import settings
from automos.settings import Settings, keys_of, load_settings


def groups(group: type[BaseModel]):
    yield group
    for field in group.model_fields.values():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from groups(field.annotation)


def test_every_group_is_had_from_the_package_itself():
    assert {group.__name__ for group in groups(Settings)} <= set(dir(settings))


def test_keys_name_groups_and_what_is_in_them_at_any_depth():
    assert keys_of(settings.InstancesSettings)[:3] == ["method", "max_range", "hdbscan"]
    keys = keys_of(Settings)
    assert {"instances", "instances.components.segments", "instances.components.segments.cell"} <= set(keys)


def test_settings_cannot_be_changed_once_made():
    with pytest.raises(ValidationError):
        load_settings("paper").tracking.max_misses = 3
