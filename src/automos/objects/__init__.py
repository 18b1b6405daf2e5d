"""The stages of the pipeline; the settings choose the method of each.

All methods of a stage return the same arrays, so that methods can be combined freely:

    candidates   log_odds (M,) float16: has moved, against has stayed;  kind (M,) uint8;  height (M,) metres;
                 solidity (M,) uint8, 255 if all rays beside a point have met the same object
    instances    ids (M,) int32, -1 for none;  stayed (M,) int32;  boxes and counts of every segment (`Detections`)
    tracking     tracks, the verdict on each, and the places of static objects beside movers (`TrackedObjects`)
    labels       label (N,), track (N,) and confidence (N,) uint8, one per point of the user's scan;  n_body, number of
                 points on the ego body

A point becomes `MOVING` in `labels.label_points`.
"""
