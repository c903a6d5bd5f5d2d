"""What the robot derives from its sensors: where it is, what stands and what moves around it, who wears what.

records ──── standing    things that stand, by what was hit again and again
│       ├─── bodies      upright things among clusters, and the scene of one moment
│       └─── clothes     the colours of tracks, from pictures
"""
