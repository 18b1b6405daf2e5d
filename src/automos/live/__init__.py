"""What a sensor sends now, labelled as it comes: packets or a replayed recording in, labels, pictures and messages out.

A thread receives and cuts scans; the labeler takes the next one when it is done with the one before. Between them is
room for four, so what is too much is left out and counted, and nothing grows.
"""
