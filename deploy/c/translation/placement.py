"""Where in a C function each local is declared: at its first assignment if that comes before every use, else above it."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass(slots=True)
class Block:
    """One list of statements, and where it lies."""

    statements: list[ast.stmt]
    parent: "Block | None" = None
    place: int = 0  # of the statement in the parent that it belongs to
    loop: bool = False  # the body of a loop

    def chain(self) -> "list[tuple[Block, int]]":
        """The blocks from the outermost to this one, each with the statement that leads to the next."""
        found: list[tuple[Block, int]] = []
        block: Block | None = self
        place = 0
        while block is not None:
            found.append((block, place))
            place, block = block.place, block.parent
        return found[::-1]


@dataclass(slots=True)
class Placement:
    """Declarations of one function."""

    at_assignment: set[tuple[int, str]] = field(
        default_factory=set
    )  # (id of the statement, name): declared by it
    ahead: dict[int, list[str]] = field(default_factory=dict)  # id of a statement -> names declared before it
    assigned: dict[str, int] = field(default_factory=dict)  # how many statements assign the name


def targets_of(statement: ast.stmt) -> list[str]:
    """The names that a statement assigns."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = list(statement.targets)
    elif isinstance(statement, (ast.AnnAssign, ast.AugAssign)):
        targets = [statement.target]
    # `a[k] = ...` assigns neither a nor k
    return [
        name.id
        for target in targets
        for name in ast.walk(target)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    ]


def _inner(statement: ast.stmt, block: Block, place: int) -> Iterator[Block]:
    if isinstance(statement, ast.If):
        yield Block(statement.body, block, place)
        yield Block(statement.orelse, block, place)
    elif isinstance(statement, ast.For):
        yield Block(statement.body, block, place, loop=True)


def _own_names(statement: ast.stmt) -> Iterator[str]:
    """Names in a statement, those of the blocks inside it left out."""
    if isinstance(statement, ast.If):
        nodes: list[ast.AST] = [statement.test]
    elif isinstance(statement, ast.For):
        nodes = [statement.iter]
    else:
        nodes = [statement]
    for node in nodes:
        for name in ast.walk(node):
            if isinstance(name, ast.Name):
                yield name.id


def _occurrences(block: Block, found: dict[str, list[tuple[Block, int]]]) -> None:
    for place, statement in enumerate(block.statements):
        for name in _own_names(statement):
            found.setdefault(name, []).append((block, place))
        for inner in _inner(statement, block, place):
            _occurrences(inner, found)


def placement_of(function: ast.FunctionDef, parameters: set[str]) -> Placement:
    """Decide for every local of a function."""
    result = Placement()
    for statement in ast.walk(function):
        if isinstance(statement, ast.stmt):
            for name in set(targets_of(statement)):
                again = 2 if isinstance(statement, ast.AugAssign) else 1
                result.assigned[name] = result.assigned.get(name, 0) + again
    occurrences: dict[str, list[tuple[Block, int]]] = {}
    _occurrences(Block(function.body), occurrences)
    for name in result.assigned:
        if name not in parameters:
            _place(name, occurrences[name], result)
    return result


def _place(name: str, where: list[tuple[Block, int]], result: Placement) -> None:
    chains = []
    for block, place in where:
        chain = block.chain()
        chain[-1] = (block, place)
        chains.append(chain)
    depth = 0
    while all(len(chain) > depth + 1 for chain in chains) and all(
        chain[depth][1] == chains[0][depth][1] and chain[depth + 1][0] is chains[0][depth + 1][0]
        for chain in chains
    ):
        depth += 1
    block, place = chains[0][depth][0], min(chain[depth][1] for chain in chains)
    first = block.statements[place]
    simple = isinstance(first, (ast.Assign, ast.AnnAssign)) and name in targets_of(first)
    reads = simple and any(
        isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Load) for n in ast.walk(first)
    )
    if simple and not reads:
        result.at_assignment.add((id(first), name))
        return
    # A value that is carried from one turn of a loop to the next must not be declared inside it.
    while block.loop or (block.parent is not None and any(b.loop for b, _ in block.chain())):
        assert block.parent is not None
        place, block = block.place, block.parent
    result.ahead.setdefault(id(block.statements[place]), []).append(name)
