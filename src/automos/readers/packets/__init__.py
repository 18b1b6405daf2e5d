"""Packets as sensors send them, in captures, Livox's files and bags: a table of sensors, and one decoder for all."""

from automos.readers.packets.sequence import FORMAT as FORMAT
