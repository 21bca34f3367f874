"""Statements of the Python subset in C: assignments, calls, if, for over a range, break, continue, return."""

import ast
from typing import Final

from deploy.c.translation.arrays import filled, own_array
from deploy.c.translation.expressions import Expressions
from deploy.c.translation.kinds import (
    INT,
    REAL,
    TIME,
    VOID,
    Array,
    Group,
    Kind,
    Record,
    Scalar,
    fields_of,
)
from deploy.c.translation.names import local_name, wrapped
from deploy.c.translation.placement import Placement, placement_of
from deploy.c.translation.scope import Scope, Value

STEP: Final = "    "


class Statements:
    """Translates the body of one function into lines."""

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.expressions = Expressions(scope)
        tree = scope.source.tree
        self._placement: Placement = placement_of(tree, set(scope.locals))
        self._pending = dict(scope.source.comments)
        self._pending = {line: text for line, text in self._pending.items() if line >= tree.body[0].lineno}
        self._rows: dict[str, int] = {}  # names of rows -> the line that declares each
        self._node: ast.AST = tree  # the present statement
        self._ahead: dict[str, int] = {}  # names whose declaration stands in `lines` at this place
        self.lines: list[str] = []
        self._indent = 1
        self._loops = 0

    def translate(self) -> list[str]:
        """The lines of the body."""
        body = self.scope.source.tree.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        self._block(body)
        for name, line in self._rows.items():
            constant = "" if name in self.scope.written else "const "
            self.lines[line] = self.lines[line].replace("?constant?", constant)
        return self.lines

    def _emit(self, text: str) -> None:
        self.lines.append(wrapped(STEP * self._indent + text))

    def _flush(self) -> None:
        """What the present statement needs done before it; its own text comes next."""
        self.scope.statement_ends(self._node)
        for text in self.scope.before:
            self._emit(text)
        self.scope.before.clear()

    def _block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            self._remarks(statement)
            for name in self._placement.ahead.get(id(statement), []):
                # the kind is known once the first assignment has been translated
                self._ahead[name] = len(self.lines)
                self.lines.append(f"{STEP * self._indent}?{name}?")
            method = getattr(self, f"_{type(statement).__name__.lower()}", None)
            if method is None:
                raise self.scope.refused(statement, f"the statement {type(statement).__name__}")
            self._node = statement
            method(statement)

    def _remarks(self, statement: ast.stmt) -> None:
        """Comments above the statement and, of a simple one, on its lines."""
        # the body of a compound statement emits its own remarks, each where it stands
        compound = isinstance(statement, (ast.If, ast.For))
        last = statement.lineno if compound else (statement.end_lineno or statement.lineno)
        texts = [self._pending.pop(line) for line in sorted(self._pending) if line <= last]
        for text in texts:
            if text:
                self._emit(f"/* {text} */")

    # -- assignments

    def _assign(self, node: ast.Assign) -> None:
        # a = b = value: the value is evaluated once in C too
        if len(node.targets) > 1:
            value = self.expressions.value(node.value)
            if value.exact is None and not value.place:
                value = self._held(node, "value", value)
            for target in node.targets:
                self._assigned(node, target, value)
            return
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and all(
            isinstance(t, (ast.Name, ast.Subscript)) for t in target.elts
        ):
            self._unpack(node, target.elts, node.value)
        else:
            self._assigned(node, target, self.expressions.value(node.value))

    def _held(self, node: ast.stmt, label: str, value: Value) -> Value:
        """A value in a temporary of its own."""
        held = self.scope.temporary(node, label, value.kind, value.c)
        return Value(held, value.kind, place=held)

    def _assigned(self, node: ast.stmt, target: ast.expr, value: Value) -> None:
        """Assign a name, a number of an array, or all numbers of one."""
        if isinstance(target, ast.Name):
            self._store(node, target.id, value)
            return
        owner = self.expressions.value(target.value) if isinstance(target, ast.Subscript) else None
        if owner is None or not isinstance(owner.kind, Array) or not isinstance(target, ast.Subscript):
            raise self.scope.refused(node, f"an assignment to {ast.unparse(target)}")
        self.scope.writes(owner.root)
        if isinstance(target.slice, ast.Slice):
            self._filled(node, target.slice, owner, value)
            return
        place = self.expressions.element(target, owner)
        if isinstance(place.kind, Array):
            raise self.scope.refused(node, f"an assignment to the row {ast.unparse(target)}")
        text = self.expressions.converted(value, place.kind, node).c
        self._flush()
        self._emit(f"{place.c} = {text};")

    def _filled(self, node: ast.stmt, part: ast.Slice, owner: Value, value: Value) -> None:
        assert isinstance(owner.kind, Array)
        if part.lower or part.upper or part.step or value.exact is None:
            raise self.scope.refused(
                node, "an assignment to a part of an array, or of more than a constant to all"
            )
        text = self.expressions.converted(value, owner.kind.item, node).c
        *loops, inner = filled(owner, text)
        self._flush()
        for loop in loops:
            self._emit(loop)
            self._indent += 1
        self._emit(inner)
        for _ in loops:
            self._indent -= 1
            self._emit("}")

    def _annassign(self, node: ast.AnnAssign) -> None:
        if node.value is None or not isinstance(node.target, ast.Name):
            raise self.scope.refused(node, "an annotation without a value")
        self._store(node, node.target.id, self.expressions.value(node.value))

    def _augassign(self, node: ast.AugAssign) -> None:
        target = node.target
        known = self.scope.locals.get(target.id) if isinstance(target, ast.Name) else None
        place = Value(known.c, known.kind) if known is not None else None
        if isinstance(target, ast.Subscript):
            place = self.expressions.value(target)  # counted as a read, which it is
            self.scope.writes(self.expressions.value(target.value).root)
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}.get(type(node.op))
        # /= may divide by zero, and the perturbed build wraps each result: both need the long form below
        if sign is not None and place is not None and not self.scope.program.perturbed:
            text = self.expressions.as_kind(node.value, place.kind)
            self._flush()
            self._emit(f"{place.c} {sign} {text};")
            return
        load = ast.copy_location(ast.parse(ast.unparse(target), mode="eval").body, node)
        whole = ast.copy_location(ast.BinOp(load, node.op, node.value), node)
        self._assigned(node, target, self.expressions.value(whole))

    def _store(self, node: ast.stmt, name: str, value: Value) -> None:
        """Assign one name, and declare it where this is the place."""
        known = self.scope.locals.get(name)
        # a record comes as a pointer to the caller's own: storing through it would change the caller's
        if known is not None and known.pointer:
            raise self.scope.refused(node, f"an assignment to the argument {name}, which is a record")
        if isinstance(value.kind, Array):
            self._array(node, name, value)
            return
        # a variable of C keeps the type of its first value
        kind = known.kind if known is not None else value.kind
        if kind != value.kind:
            value = self.expressions.converted(value, kind, node)
        c = self.scope.program.needs_kind(kind)
        here, once = (id(node), name) in self._placement.at_assignment, self._placement.assigned[name] == 1
        if here and once and isinstance(kind, Record) and "->" in value.place:
            # A part of an argument, which nobody changes: a pointer instead of a copy.
            local = self.scope.declare(name, kind, pointer=True)
            self._flush()
            self._emit(f"const {c} *{local.c} = &{value.place};")
            return
        local = self.scope.declare(name, kind)
        self._flush()
        if here:
            constant = "const " if once else ""
            # a compound literal of the declared type is an initialiser; a cast stays a cast
            text = value.c.removeprefix(f"({c})") if value.c.startswith(f"({c}){{") else value.c
            self._emit(f"{constant}{c} {local.c} = {text};")
            return
        if name in self._ahead:
            zero = literal_zero(kind)
            place = self._ahead.pop(name)
            self.lines[place] = self.lines[place].replace(f"?{name}?", f"{c} {local.c} = {zero};")
        self._emit(f"{local.c} = {value.c};")

    def _array(self, node: ast.stmt, name: str, value: Value) -> None:
        """A name for an array of the function's own, or for a row of another one."""
        if name in self.scope.locals or (id(node), name) not in self._placement.at_assignment:
            raise self.scope.refused(
                node, f"an array {name} that is assigned more than once or used outside of its block"
            )
        self._flush()
        kind = value.kind
        assert isinstance(kind, Array)
        if value.fresh:
            local = self.scope.declare(name, kind)
            for text in own_array(local.c, self.scope.program.needs_kind(kind), value):
                self._emit(text)
            return
        local = self.scope.declare(name, kind, pointer=True)
        local.root = value.root
        self._rows[name] = len(self.lines)
        self._emit(f"?constant?{kind.item.c} *{local.c} = {value.c};")

    def _unpack(self, node: ast.Assign, targets: list[ast.expr], source: ast.expr) -> None:
        if isinstance(source, ast.Tuple):
            self._each(node, targets, list(source.elts))
        elif (
            isinstance(source, ast.IfExp)
            and isinstance(source.body, ast.Tuple)
            and isinstance(source.orelse, ast.Tuple)
        ):
            # every name gets its own choice, so the test is evaluated again for each: a name costs nothing and cannot change
            if not isinstance(source.test, ast.Name):
                raise self.scope.refused(node, "a choice of tuples by more than a name")
            pairs = zip(source.body.elts, source.orelse.elts, strict=True)
            self._each(
                node, targets, [ast.copy_location(ast.IfExp(source.test, a, b), source) for a, b in pairs]
            )
        else:
            value = self.expressions.value(source)
            # the parts are read one by one: a call must not be repeated for each
            if not value.place:
                label = ast.unparse(source.func if isinstance(source, ast.Call) else targets[0])
                value = self._held(node, label, value)
            parts = self._parts(node, value)
            if len(parts) != len(targets):
                raise self.scope.refused(node, f"{len(targets)} names for {len(parts)} values")
            for target, part in zip(targets, parts, strict=True):
                self._assigned(node, target, part)

    def _parts(self, node: ast.stmt, value: Value) -> list[Value]:
        if isinstance(value.kind, Group):
            return [
                Value(value.field(f"item{k}"), kind, place=value.field(f"item{k}"))
                for k, kind in enumerate(value.kind.items)
            ]
        if isinstance(value.kind, Record):
            found = []
            for name, kind in fields_of(value.kind.python).items():
                if kind is None:
                    raise self.scope.refused(node, f"the field {name} is of no known kind")
                text = value.field(local_name(name))
                found.append(Value(text, kind, place=text))
            return found
        raise self.scope.refused(node, f"unpacking {value.kind}")

    def _each(self, node: ast.Assign, targets: list[ast.expr], sources: list[ast.expr]) -> None:
        """Several targets at once; through temporaries where a value reads what is assigned before it."""
        if len(targets) != len(sources):
            raise self.scope.refused(node, f"{len(targets)} names for {len(sources)} values")
        if not self._crossed(targets, sources):
            for target, source in zip(targets, sources, strict=True):
                self._assigned(node, target, self.expressions.value(source))
            return
        values = []
        for target, source in zip(targets, sources, strict=True):
            value = self.expressions.value(source)
            label = f"new_{target.id}" if isinstance(target, ast.Name) else "new"
            values.append(self._held(node, label, value))
        for target, value in zip(targets, values, strict=True):
            self._assigned(node, target, value)

    def _crossed(self, targets: list[ast.expr], sources: list[ast.expr]) -> bool:
        """Whether a value reads a name, or an array, that is assigned before it."""
        bases = [t.value if isinstance(t, ast.Subscript) else t for t in targets]
        names = [self.scope.memory(base.id) for base in bases if isinstance(base, ast.Name)]
        return any(
            isinstance(n, ast.Name) and self.scope.memory(n.id) in names[:k]
            for k, source in enumerate(sources)
            for n in ast.walk(source)
        )

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Call):
            raise self.scope.refused(node, f"the statement {ast.unparse(node)}")
        value = self.expressions.value(node.value)
        self._flush()
        self._emit(f"{value.c};" if value.kind == VOID else f"(void){value.c};")

    # -- control

    def _if(self, node: ast.If) -> None:
        test = self.expressions.truth(node.test)
        self._flush()
        self._emit(f"if ({test.c}) {{")
        self._inside(node.body)
        if node.orelse:
            self._emit("} else {")
            self._inside(node.orelse)
        self._emit("}")

    def _inside(self, statements: list[ast.stmt]) -> None:
        self._indent += 1
        self._block(statements)
        self._indent -= 1

    def _for(self, node: ast.For) -> None:
        call = node.iter
        if node.orelse or not (
            isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
        ):
            raise self.scope.refused(node, "a loop over more than a range")
        if not isinstance(node.target, ast.Name) or len(call.args) > 2:
            raise self.scope.refused(node, "a range with a step")
        bounds = [self.expressions.value(bound) for bound in call.args]
        if any(bound.kind != INT for bound in bounds):
            raise self.scope.refused(node, "a range whose bounds are no integers")
        name = node.target.id
        self._loops += 1
        # nested loops over `_` need variables of their own
        if name == "_":
            name = f"turn_{self._loops}"
        local = self.scope.declare(name, INT)
        self._flush()
        first = bounds[0].c if len(bounds) == 2 else "0"
        last = bounds[-1].c
        if bounds[-1].exact is None:
            # Python evaluates the bound once
            self._emit(f"const int32_t turns_{self._loops} = {last};")
            last = f"turns_{self._loops}"
        self._emit(f"for (int32_t {local.c} = {first}; {local.c} < {last}; ++{local.c}) {{")
        self._inside(node.body)
        self._emit("}")

    def _break(self, node: ast.Break) -> None:
        self._emit("break;")

    def _continue(self, node: ast.Continue) -> None:
        self._emit("continue;")

    def _pass(self, node: ast.Pass) -> None:
        self._emit("/* nothing */")

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            raise self.scope.refused(node, "a return without a value")
        kind: Kind = self.scope.result
        # converted item by item, for a tuple may hold an integer where the signature says a real number
        if isinstance(node.value, ast.Tuple) and isinstance(kind, Group):
            parts = [
                self.expressions.as_kind(item, k) for item, k in zip(node.value.elts, kind.items, strict=True)
            ]
            text = f"({self.scope.program.needs_kind(kind)}){{{', '.join(parts)}}}"
        else:
            text = self.expressions.as_kind(node.value, kind)
        self._flush()
        self._emit(f"return {text};")


def literal_zero(kind: Kind) -> str:
    """What a variable holds that is declared before its first assignment; Python would not let it be read before."""
    if isinstance(kind, Scalar):
        return {REAL: "R(0.0)", INT: "0", TIME: "0"}.get(kind, "false")
    return "{0}"
