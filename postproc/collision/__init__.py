"""The only user of fcl and trimesh: solids, pairs, the pair that hit, motions in between."""
