"""The compliant control: slip PID, virtual suspension, feed-forward support and posture."""
