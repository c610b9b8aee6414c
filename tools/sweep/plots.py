"""Charts as files, SVG and PNG, by matplotlib."""
import hashlib
import io
import json
import os
import statistics

from sweep import table
from sweep.page import column_names
from sweep.runner import write_whole
from sweep.spec import Plot

MADE_OF = ".made-of"  # the file with a digest of the results
MARKERS = "o^sDvPX*"  # one less than colours, so that no two of the first 72 codecs look alike
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a6a00", "#56b4e9", "#4d4d4d", "#e69f00", "#882255")


def available():
    try:
        import matplotlib  # noqa: F401
        import numpy  # noqa: F401
    except ImportError:
        return False
    return True


def digest(spec, flats):
    return hashlib.sha256(json.dumps([flats, repr(spec.plots)]).encode()).hexdigest() + "\n"


def fresh(spec, flats, folder):
    """Whether the plots that are there are those of these results."""
    try:
        with open(os.path.join(folder, MADE_OF), encoding="ascii") as file:
            return file.read() == digest(spec, flats)
    except (OSError, ValueError):
        return False


def usual_plots(spec, flats, columns):
    """What every sweep draws, and what its spec asks for."""
    times = [f"{render.name}.ms_avg" for render in spec.renders] + ["decode_seconds", "encode_seconds"]
    inputs, codecs = frozenset(entry.name for entry in spec.inputs), frozenset(codec.name for codec in spec.codecs)
    size, error = table.usual_axes(columns)
    usual = [Plot("size-error", "Size and error", size, error, False, False, (), "front", "", "", inputs, codecs)]
    for name in sorted(inputs):  # the first time that the input has: not every picture is of every input
        known = {column for values in flats if values["input"] == name for column, value in values.items() if finite(value)}
        usual += [Plot("time-error", "Time and error", time, error, False, False, (), "front", "", "", frozenset([name]), codecs)
                  for time in times if time in known][:1]
    asked = {(table.find_column(plot.x, columns), table.find_column(plot.y, columns)) for plot in spec.plots}
    return [plot for plot in usual if plot.y in columns and (plot.x, plot.y) not in asked] + list(spec.plots)


def write(spec, flats, folder):
    """Writes the plots of each input into the folder; names of columns that are not there are returned."""
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "vox-sweep"  # the same file for the same results
    columns = table.columns_of(flats)
    names, unknown, written = column_names(columns), [], set()
    os.makedirs(folder, exist_ok=True)
    for plot in usual_plots(spec, flats, columns):
        x, y = table.find_column(plot.x, columns), table.find_column(plot.y, columns)
        if x is None or y is None:
            unknown.append(plot.x if x is None else plot.y)
            continue
        for data, figure in figures(plot, x, y, flats, names, columns):
            for ending in ("svg", "png"):
                file = io.BytesIO()
                figure.savefig(file, format=ending, dpi=120, metadata={"Date": None} if ending == "svg" else None)
                written.add(f"{plot.name}{data}.{ending}")
                write_whole(os.path.join(folder, f"{plot.name}{data}.{ending}"), file.getvalue())
    for name in os.listdir(folder):  # those of an earlier spec
        if name.endswith((".svg", ".png")) and name not in written:
            os.unlink(os.path.join(folder, name))
    if not unknown:
        write_whole(os.path.join(folder, MADE_OF), digest(spec, flats))
    return unknown


def figures(plot, x, y, flats, names, columns):
    """(ending of the file's name, figure): one an input; one of all of them where a curve is fitted."""
    fit, baseline = plot.fit, table.find_column(plot.baseline, columns)
    inputs = list(dict.fromkeys(values["input"] for values in flats))
    endings = dict(zip(inputs, endings_of(inputs)))
    inputs = [name for name in inputs if name in plot.inputs]
    codecs = list(dict.fromkeys(values["codec"] for values in flats))  # a codec looks the same in all plots
    for group in ([inputs] if fit else [[name] for name in inputs]):
        of_group = [values for values in flats if values["input"] in group and values["codec"] in plot.codecs and finite(values.get(x))]
        points = [values for values in of_group if finite(values.get(y))]
        exact = [values for values in of_group if table.number(values.get(y)) == float("inf")]
        if not points and not exact:
            continue
        figure, axes = new_figure()
        labels = []
        for codec in dict.fromkeys(values["codec"] for values in of_group):
            own = sorted((values for values in points if values["codec"] == codec), key=lambda values: table.number(values[x]))
            across, up = ([table.number(values[column]) for values in own] for column in (x, y))
            color, marker = (kinds[codecs.index(codec) % len(kinds)] for kinds in (COLORS, MARKERS))
            if own:
                axes.plot(across, up, marker=marker, color=color, label=codec, linestyle="none",
                          markersize=5, alpha=0.85)
            if plot.line == "all" and not fit:
                axes.plot(across, up, color=color, linewidth=1)
            elif plot.line == "front" and not fit:
                draw_front(axes, x, y, across, up, color)
            if fit:
                draw_fit(axes, across, up, color, codec)
            labels += zip(label_texts(plot.label, own, columns), across, up)
            lossless = [table.number(values[x]) for values in exact if values["codec"] == codec]
            if lossless:  # infinitely good: the best of these has a line
                axes.axvline((max if table.higher_is_better(x) else min)(lossless), color=color, linestyle=":", label=f"{codec}, lossless")
        if baseline:
            known = [table.number(values[baseline]) for values in of_group if finite(values.get(baseline))]
            if known:
                axes.axhline(statistics.median(known), color="#2a7a2a", linewidth=1.5, label=names.get(baseline, baseline))
        axes.set(title=plot.title if fit else f"{plot.title}: {group[0]}", xlabel=names.get(x, x), ylabel=names.get(y, y),
                 xscale="log" if plot.log_x else "linear", yscale="log" if plot.log_y else "linear")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        place_labels(figure, axes, labels)
        yield "" if fit else endings[group[0]], figure


def label_texts(labels, rows, columns):
    """What stands beside points: those of the options that they have."""
    found = [table.find_column(label, columns) for label in labels]
    texts = [[str(values[column]) for column in found if column in values] for values in rows]
    return [f"({', '.join(words)})" if len(words) > 1 else "".join(words) for words in texts]


def place_labels(figure, axes, labels):
    """Beside their points, on the side where no other one is; where there is none, the label is left out."""
    if not any(text for text, _, _ in labels):
        return
    from matplotlib.transforms import Bbox
    figure.draw_without_rendering()  # settles where things are
    room, taken = axes.get_window_extent(), [axes.get_legend().get_window_extent()]
    taken += [Bbox.from_bounds(x - 3, y - 3, 6, 6) for _, a, b in labels for x, y in [axes.transData.transform((a, b))]]
    for text, a, b in (label for label in labels if label[0]):
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1)):
            note = axes.annotate(text, (a, b), fontsize=6.5, xytext=(4 * x, 4 * y if x else 7 * y), textcoords="offset points",
                                 ha=("right", "center", "left")[x + 1], va="bottom" if y > 0 else "top")
            box = note.get_window_extent()
            if not box.overlaps(room) or box.x1 > room.x1 or box.x0 < room.x0 or box.count_overlaps(taken):
                note.remove()
                continue
            taken.append(box)
            break


def endings_of(inputs):
    """What an input adds to the names of files: nothing if there is one only, and never the same as another."""
    used = []
    for name in inputs:
        ending = "-" + "".join(c if c.isalnum() or c in ".-" else "-" for c in name)
        used.append("" if len(inputs) == 1 else ending if ending not in used else f"{ending}-{len(used)}")
    return used


def new_figure():
    from matplotlib.figure import Figure  # without pyplot, which keeps figures
    figure = Figure(figsize=(7, 5), layout="constrained")
    return figure, figure.add_subplot()


def draw_front(axes, x, y, across, up, color):
    """Through those points of a codec that none of its others beats."""
    turned = [[-value for value in values] if table.higher_is_better(column) else values
              for column, values in ((x, across), (y, up))]
    best = table.front(list(zip(*turned)))
    axes.plot([across[i] for i in best], [up[i] for i in best], color=color, linewidth=1)


def draw_fit(axes, across, up, color, codec):
    """y = a x^b by least squares of the logarithms, and how much of their variance it explains."""
    import numpy
    points = [(a, b) for a, b in zip(across, up) if a > 0 and b > 0]
    if len({a for a, _ in points}) < 2:
        return
    u, v = (numpy.log([point[i] for point in points]) for i in (0, 1))
    slope, offset = numpy.polyfit(u, v, 1)
    spread = ((v - v.mean()) ** 2).sum()
    share = 1 - ((v - slope * u - offset) ** 2).sum() / spread if spread > 0 else 1
    line = numpy.linspace(min(across), max(across), 100)
    axes.plot(line, numpy.exp(offset) * line**slope, color=color, linewidth=1,
              label=f"{codec}: {numpy.exp(offset):.3g} x^{slope:.3g}, R² {share:.2f}")


def finite(value):
    found = table.number(value)
    return found is not None and abs(found) != float("inf") and found == found
