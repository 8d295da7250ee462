"""Lines that say how accurate an odometry is over several seeds."""
import statistics


def print_line(title, values, unit):
    """Mean, spread and the value that is farthest from 0."""
    print(f"  {title}: mean {statistics.mean(values):.3f}, spread {statistics.pstdev(values):.3f}, "
          f"largest {max(values, key=abs):.3f} {unit}")


def print_scale_and_path(rows):
    """Of runs that are in metres: rows with `scale_error`, `ate_share` and `ate_sim3_share`, shares of 1."""
    print_line("scale's error", [100 * row["scale_error"] for row in rows], "%")
    print_line("ATE without correction of scale", [100 * row["ate_share"] for row in rows], "% of the path")
    print_line("ATE with it", [100 * row["ate_sim3_share"] for row in rows], "% of the path")


def metric_rows(name, rows):
    """The runs that are in metres, after saying how many they are."""
    metric = [row for row in rows if row["scale"] == "metric"]
    print(f"{name}: {len(metric)} of {len(rows)} metric")
    return metric
