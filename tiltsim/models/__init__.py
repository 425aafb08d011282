"""MJCF to compiled MuJoCo models; knows no scenarios."""
