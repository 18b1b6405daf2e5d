"""Many recordings: cut into units, done by processes or a cluster, kept on disks or in buckets, accounted for."""
