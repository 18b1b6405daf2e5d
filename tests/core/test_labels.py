import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.core.label_files import pack, to_mos
from automos.core.labels import Label


@pytest.mark.parametrize(
    ("semantic", "label"),
    [
        (0, Label.UNLABELED),
        (1, Label.UNLABELED),
        (8, Label.UNLABELED),
        (9, Label.STATIC),
        (10, Label.STATIC),
        (99, Label.STATIC),
        (100, Label.UNLABELED),
        (250, Label.UNLABELED),
        (251, Label.MOVING),
        (252, Label.MOVING),
        (259, Label.MOVING),
        (260, Label.UNLABELED),
        (65535, Label.UNLABELED),
    ],
)
def test_semantic_classes_become_what_the_benchmark_counts(semantic, label):
    assert to_mos(np.array([semantic]))[0] == label


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_the_instance_in_the_upper_bits_does_not_change_the_class(semantic, instance):
    assert to_mos(np.array([semantic | instance << 16], np.uint32)) == to_mos(np.array([semantic]))


def test_labels_without_instances_are_packed_as_they_are():
    packed = pack(np.array([0, 9, 251], np.uint8))
    assert packed.dtype == np.uint32
    np.testing.assert_array_equal(packed, [0, 9, 251])


@pytest.mark.parametrize(
    ("instance", "stored"), [(-1, 0), (0, 0), (1, 1), (65535, 65535), (65536, 1), (131070, 65535), (131071, 1)]
)
def test_instance_numbers_fill_the_upper_bits_and_wrap_but_never_to_none(instance, stored):
    packed = pack(np.array([251], np.uint8), np.array([instance]))
    assert packed[0] & 0xFFFF == Label.MOVING
    assert packed[0] >> 16 == stored


@given(st.lists(st.sampled_from(list(Label)), min_size=1, max_size=20), st.integers(0, 70000))
def test_packed_labels_are_read_back_by_the_benchmarks_mapping(labels, instance):
    packed = pack(np.array(labels, np.uint8), np.full(len(labels), instance))
    np.testing.assert_array_equal(to_mos(packed), labels)
