"""Documents that a JSON Schema describes, or nearly so, and text that is damaged."""

from __future__ import annotations

import json

STRANGE = (
    *(0, -1, 1, 2**63, 10**400, -0.0, 5e-324, 1e308, 1e400, -1e400, float("nan"), True, False),
    *("", "a", "\x1b]0;x\x07", "\u202eb\n\x00", "飛行 🚁", "../../etc/passwd", "a.py:b"),
    *("x" * 5000, [], {}, [[]], [1.0] * 40, {"a": {"b": [{"c": 1}]}}, ["1", 2, True]),
)
"""Values that a schema rarely allows; values that TOML cannot hold are written all the same."""


class Documents:
    """Draws documents from a JSON Schema.

    Args:
        schema: The schema, with its ``$defs``.
        random: Source of all draws.
        strange: Probability that a value is one of `STRANGE`.
    """

    def __init__(self, schema, random, strange=0.02):
        self.schema, self.random, self.strange = schema, random, strange

    def draw(self):
        """A document."""
        return self._table(self.schema, 0)

    def value(self, schema, depth=0):
        """A value under a part of the schema."""
        random = self.random
        schema = self._resolved(schema)
        if random.random() < self.strange or depth > 12:
            return random.choice(STRANGE)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return random.choice(schema["enum"])
        kind = schema.get("type")
        if kind == "object":
            return self._table(schema, depth)
        if kind == "array":
            return self._list(schema, depth)
        if kind in {"number", "integer"}:
            return self._number(schema, kind)
        return {"boolean": random.random() < 0.5, "string": self.text()}.get(kind, self.text())

    def text(self):
        """A short text, or a name that means something somewhere."""
        return self.random.choice(("a", "gait.period", "ch04", "simulation.seed", "2 * m", "x_1"))

    def _resolved(self, schema):
        """The schema behind references, one option of a union chosen."""
        for _ in range(20):
            if "$ref" in schema:
                schema = self.schema["$defs"][schema["$ref"].rpartition("/")[2]]
                continue
            options = schema.get("oneOf") or schema.get("anyOf") or schema.get("allOf")
            if not options:
                return schema
            schema = self.random.choice(options)
        return schema

    def _table(self, schema, depth):
        random = self.random
        properties, required = schema.get("properties", {}), schema.get("required", ())
        often = 3 / max(3, len(properties))
        chosen = {
            key: self.value(part, depth + 1)
            for key, part in properties.items()
            if (random.random() < 0.97 if key in required or "const" in part else False)
            or random.random() < often
        }
        extra = schema.get("additionalProperties")
        if isinstance(extra, dict):
            names = [self.text() for _ in range(random.randrange(3))]
            chosen |= {name: self.value(extra, depth + 1) for name in names}
        if random.random() < self.strange:
            unknown = random.choice(("", "naem", "a b", "\x1b[2J", "k" * 300))
            chosen[unknown] = random.choice(STRANGE)
        return chosen

    def _list(self, schema, depth):
        random = self.random
        items = [*schema.get("prefixItems", ())]
        if not items:
            count = random.choice((schema.get("minItems", 0), 1, 2, 4, 5))
            items = [schema.get("items", {})] * count
        if random.random() < self.strange:
            items = items[1:] if random.random() < 0.5 else items * 2
        return [self.value(item, depth + 1) for item in items]

    def _number(self, schema, kind):
        random = self.random
        low = schema.get("minimum", schema.get("exclusiveMinimum", -10.0))
        high = schema.get("maximum", schema.get("exclusiveMaximum", 10.0))
        near = random.uniform(max(low, -5.0), min(high, 5.0)) if low < 5.0 else low
        values = [near, near, near, low, high, schema.get("default")]
        values += schema.get("examples", [])
        value = random.choice([v for v in values if isinstance(v, int | float)])
        return int(value) if kind == "integer" and abs(value) < 1e300 else value


def toml_text(value):
    """A value as TOML, in line, whether or not TOML can hold it."""
    if isinstance(value, dict):
        inner = ", ".join(f"{json.dumps(key)} = {toml_text(item)}" for key, item in value.items())
        return f"{{ {inner} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value)  # also nan and inf


def toml_document(document):
    """A table as the text of a TOML file."""
    return "".join(f"{json.dumps(k)} = {toml_text(v)}\n" for k, v in document.items())


def dotted(document):
    """The values of a document by dotted key, tables and entries of lists included."""
    values = {}
    for key, value in document.items():
        values[key] = value
        if isinstance(value, dict):
            values |= {f"{key}.{inner}": part for inner, part in dotted(value).items()}
        elif isinstance(value, list):
            values |= {f"{key}[{place}]": part for place, part in enumerate(value)}
    return values


def damaged(content, random):
    """Bytes with a few flips, cuts, repetitions or insertions."""
    content = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 8))):
        place = random.randrange(len(content) + 1)
        match random.randrange(5):
            case 0 if place < len(content):
                content[place] ^= 1 << random.randrange(8)
            case 1:
                del content[place : place + random.choice((1, 4, 100))]
            case 2:
                content[place:place] = random.randbytes(random.choice((1, 4)))
            case 3:
                content[place:place] = content[place : place + random.choice((1, 30))]
            case 4 if random.random() < 0.2:
                del content[place:]
    return bytes(content)
