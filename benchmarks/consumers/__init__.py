"""Proofs that programs of others read what is exported."""
