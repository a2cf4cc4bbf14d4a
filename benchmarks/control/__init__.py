"""What the compliant control is worth against the kinematic one, part by part and case by case;
`python -m benchmarks.control`.
"""
