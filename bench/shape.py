"""The shape of the source tree in figures: size, imports, longest parts, comments. For reviewers and for tests/test_shape.py.

    python -m bench.shape [TREE...] [--out docs/results/shape.md]

TREE is a checkout, by default this one; with two, the first is printed as before, the second as after. A module is a Python file of a
top-level package other than tests. Imports are counted wherever they stand in a file, also within functions and for types alone.
"""

import argparse
import ast
import graphlib
import io
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parent.parent
ORDER = (
    "loaderhil",
    "studies",
    "identify",
    "diagnosis",
    "report",
    "hil",
    "discrepancy",
    "plant",
    "ecu",
    "dbc",
    "configuration",
    "bus",
)
BENCHES = ("bench",)


@dataclass(frozen=True, slots=True)
class Function:
    """One function or method."""

    where: str  # module:name
    lines: int  # from `def` to its end, docstring included; functions within it count for it as well
    body_lines: int  # the same without signature and docstring: commands declare their options with their help in the signature


@dataclass(frozen=True, slots=True)
class Module:
    """One Python file."""

    name: str  # dotted
    path: Path  # within the tree
    lines: int
    comment_lines: int  # lines that hold a comment and nothing else
    commented_lines: int  # lines that hold a comment at all
    filled_lines: int  # lines that are not blank
    functions: tuple[Function, ...]
    imports: frozenset[str]  # modules and names as written, absolute


@dataclass(frozen=True, slots=True)
class Shape:
    """Figures of some modules and of the imports among them."""

    modules: tuple[Module, ...]
    circles: tuple[tuple[str, ...], ...]  # modules that import each other, largest first
    levels: int  # modules on the longest chain of imports; a circle counts once

    @property
    def lines(self) -> int:
        return sum(m.lines for m in self.modules)

    @property
    def longest_module(self) -> Module:
        return max(self.modules, key=lambda m: m.lines)

    @property
    def functions(self) -> list[Function]:
        return [f for m in self.modules for f in m.functions]

    @property
    def longest_function(self) -> Function:
        return max(self.functions, key=lambda f: f.lines)

    @property
    def fullest_folder(self) -> int:
        """Modules in the folder that holds most of them, `__init__` not counted."""
        folders = [m.path.parent for m in self.modules if m.path.name != "__init__.py"]
        return max(folders.count(f) for f in set(folders))

    def comment_share(self, *, alone: bool) -> float:
        """Share of the lines that are not blank; alone: lines that hold nothing but the comment."""
        found = sum(m.comment_lines if alone else m.commented_lines for m in self.modules)
        return found / max(sum(m.filled_lines for m in self.modules), 1)


def _imports(tree: ast.AST, package: str) -> Iterator[str]:
    """Absolute names of what a file imports; of `from a import b` both a and a.b, since b may be a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            # `target` shortens it to the module it lies in, so that both forms count once
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _first_statement(function: ast.FunctionDef | ast.AsyncFunctionDef) -> ast.stmt:
    """What a function does first; its docstring if it does nothing else."""
    documented = ast.get_docstring(function, clean=False) is not None and len(function.body) > 1
    return function.body[1 if documented else 0]


def read_module(tree: Path, path: Path) -> Module:
    """One file of a tree; path is absolute."""
    source = path.read_text(encoding="utf-8")
    inside = path.relative_to(tree)
    parts = inside.with_suffix("").parts
    # a package is called by its folder
    is_package = parts[-1] == "__init__"
    name = ".".join(parts[:-1] if is_package else parts)
    parsed = ast.parse(source)
    lines = source.splitlines()
    # by tokens: a # in a string is no comment
    comments = [
        t.start for t in tokenize.generate_tokens(io.StringIO(source).readline) if t.type == tokenize.COMMENT
    ]
    functions = [
        Function(
            f"{name}:{n.name}",
            lines=(n.end_lineno or n.lineno) - n.lineno + 1,
            body_lines=(n.end_lineno or n.lineno) - _first_statement(n).lineno + 1,
        )
        for n in ast.walk(parsed)
        if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    return Module(
        name=name,
        path=inside,
        lines=len(lines),
        comment_lines=sum(not lines[row - 1][:column].strip() for row, column in comments),
        commented_lines=len({row for row, _ in comments}),
        filled_lines=sum(bool(line.strip()) for line in lines),
        functions=tuple(functions),
        imports=frozenset(_imports(parsed, name if is_package else name.rpartition(".")[0])),
    )


def read_tree(tree: Path) -> list[Module]:
    """All modules of a tree's top-level packages."""
    # also packages that are not in ORDER: a new one must not be left out of the table
    tops = [p.parent for p in sorted(tree.glob("*/__init__.py")) if p.parent.name != "tests"]
    tops += [tree / name for name in ORDER if (tree / name).is_dir() and tree / name not in tops]
    files = (f for top in tops for f in sorted(top.rglob("*.py")) if "__pycache__" not in f.parts)
    return [read_module(tree, f) for f in files]


def import_graph(modules: Sequence[Module]) -> dict[str, set[str]]:
    """Modules that each module imports, of these modules alone."""
    known = {m.name for m in modules}

    def target(name: str) -> str | None:
        while name and name not in known:
            name = name.rpartition(".")[0]
        return name or None

    return {m.name: {t for i in m.imports if (t := target(i)) and t != m.name} for m in modules}


def circles_and_levels(graph: Mapping[str, set[str]]) -> tuple[list[tuple[str, ...]], int]:
    """Groups of modules that import each other, and the length of the longest chain of imports with each group as one."""
    names = sorted(graph)
    index = {name: i for i, name in enumerate(names)}
    pairs = [(index[a], index[b]) for a, targets in graph.items() for b in targets]
    rows, columns = np.array(pairs or [(0, 0)]).T
    matrix = csr_array((np.ones(rows.size), (rows, columns)), shape=(len(names), len(names)))
    count, group = connected_components(matrix, connection="strong")
    members = [tuple(n for n in names if group[index[n]] == g) for g in range(count)]
    # the graph of the groups has no circle: each group is then one level
    lower: dict[int, set[int]] = {g: set() for g in range(count)}
    for a, b in pairs:
        if group[a] != group[b]:
            lower[int(group[a])].add(int(group[b]))
    depth: dict[int, int] = {}
    for g in graphlib.TopologicalSorter(lower).static_order():
        depth[g] = 1 + max((depth[below] for below in lower[g]), default=0)
    circles = sorted((m for m in members if len(m) > 1), key=lambda m: (-len(m), m))
    return circles, max(depth.values(), default=0)


def shape(modules: Sequence[Module]) -> Shape:
    """The figures of these modules; imports of others do not count."""
    circles, levels = circles_and_levels(import_graph(modules))
    return Shape(tuple(modules), tuple(circles), levels)


def by_package(modules: Sequence[Module]) -> dict[str, Shape]:
    """The shape of each top-level package, highest first."""
    names = sorted(
        {m.name.split(".")[0] for m in modules},
        key=lambda n: (ORDER + BENCHES).index(n) if n in ORDER + BENCHES else -1,
    )
    return {name: shape([m for m in modules if m.name.split(".")[0] == name]) for name in names}


HEADS = (
    "folder",
    "files",
    "lines",
    "levels",
    "modules in circles",
    "fullest folder",
    "longest module",
    "longest function",
    "longest body",
    "median / 95 % function",
    "comment lines",
    "lines with comment",
)


def row(name: str, s: Shape) -> tuple[str, ...]:
    """The figures of one package as cells."""
    long = s.longest_module
    middle, high = np.percentile([f.lines for f in s.functions] or [0], (50, 95))
    function = s.longest_function if s.functions else Function("", 0, 0)
    return (
        name,
        f"{len(s.modules)}",
        f"{s.lines}",
        f"{s.levels}",
        " + ".join(str(len(c)) for c in s.circles) or "0",
        f"{s.fullest_folder}",
        f"{long.lines} `{long.name.partition('.')[2] or long.name}`",
        f"{function.lines} `{function.where.rpartition('.')[2]}`" if s.functions else "–",
        f"{max((f.body_lines for f in s.functions), default=0)}",
        f"{middle:.0f} / {high:.0f}",
        f"{s.comment_share(alone=True):.1%}",
        f"{s.comment_share(alone=False):.1%}",
    )


def table(tree: Path) -> list[str]:
    """The Markdown table of one tree."""
    modules = read_tree(tree)
    product = [m for m in modules if m.name.split(".")[0] not in BENCHES]
    rows = [row(f"`{name}/`", s) for name, s in by_package(modules).items()]
    rows.append(row("product in all", shape(product)))
    return [
        "| " + " | ".join(HEADS) + " |",
        "|---|" + "---:|" * 5 + "---|---|" + "---:|" * 4,
        *("| " + " | ".join(cells) + " |" for cells in rows),
    ]


def commit_of(tree: Path) -> str:
    """The tree's commit, or nothing where git does not know it."""
    run = subprocess.run(
        ["git", "-C", str(tree), "rev-parse", "--short=10", "HEAD"],
        capture_output=True,
        text=True,
        check=False,
    )
    return run.stdout.strip() if run.returncode == 0 else ""


def page(trees: Sequence[tuple[str, str, Path]]) -> str:
    """The page of docs/results; trees: title, commit, folder of each."""
    parts = [
        "# The shape of the source tree",
        "",
        "Made by `python -m bench.shape BEFORE AFTER --out docs/results/shape.md`. `tests/test_shape.py` holds the limits.",
    ]
    parts += [
        "",
        "Levels: modules on the longest chain of imports within the folder. Circles: sizes of groups of modules that import each other, whichever kind of import "
        "closes the circle. Fullest folder: modules in one directory. A function's lines include its docstring and its signature, in which commands declare their options; its body is the rest. Comment lines hold nothing but a comment; shares are of "
        "lines that are not blank.",
    ]
    for title, commit, tree in trees:
        parts += ["", f"## {title}" + (f", commit {commit}" if commit else ""), "", *table(tree)]
    return "\n".join(parts) + "\n"


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.shape", description=__doc__)
    parser.add_argument("trees", nargs="*", type=Path, default=[ROOT], metavar="TREE")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the page there")
    parser.add_argument(
        "--commits", nargs="*", default=[], help="commits of the trees, where git does not know them"
    )
    options = parser.parse_args(argv)
    trees = [tree.resolve() for tree in options.trees]
    for tree in trees:
        if not tree.is_dir():
            parser.error(
                f"{tree}: no such folder; a commit has to be checked out first (git worktree add DIR COMMIT)"
            )
    titles = ("Before", "After") if len(trees) == 2 else tuple(tree.name for tree in trees)
    commits = [*options.commits, *map(commit_of, trees[len(options.commits) :])]
    text = page(list(zip(titles, commits, trees, strict=True)))
    if options.out is not None:
        options.out.write_text(text, encoding="utf-8")
        text = str(options.out) + "\n"
    sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
