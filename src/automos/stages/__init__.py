"""The stages as the pipeline runs them: what is known of scans in, more of it out, each by the method that is set.

Every method of a stage leaves the same arrays, so that methods can be combined freely:

    candidates   log_odds (M,) float16: has moved, against has stayed;  kind (M,) uint8;  height (M,) metres;
                 solidity (M,) uint8, 255 where all rays beside a point have met the same thing
    instances    ids (M,) int32, -1 for none;  stayed (M,) int32;  boxes and counts of every segment (`Detections`)
    tracking     tracks, the verdict on each, and the places that what stays beside movers has held (`TrackedObjects`)
    labels       label (N,), track (N,) and confidence (N,) uint8, one per point of the user's scan;  n_body, how many
                 of them ride along with the sensor

A point becomes `MOVING` in `labels.label_points`.
"""
