"""A STEP file of a box, written by hand: B-rep of six planes, any SI unit of length."""

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]


class _Lines:
    """Entities under way, each called by its number."""

    def __init__(self):
        self.text = []

    def __call__(self, entity):
        self.text.append(f"#{len(self.text) + 1}={entity};")
        return f"#{len(self.text)}"

    def triple(self, word, values):
        return self(f"{word}('',({','.join(repr(float(v)) for v in values)}))")

    def placement(self, point, z, x):
        at = self.triple("CARTESIAN_POINT", point)
        axes = ",".join(self.triple("DIRECTION", d) for d in (z, x))
        return self(f"AXIS2_PLACEMENT_3D('',{at},{axes})")


def _edge(out, edges, at, ends, vertex):
    key = tuple(sorted(ends))
    if key not in edges:
        step = [b - a for a, b in zip(at[key[0]], at[key[1]], strict=True)]
        length = sum(v * v for v in step) ** 0.5
        along = out.triple("DIRECTION", [v / length for v in step])
        vector = out(f"VECTOR('',{along},{length!r})")
        line = out(f"LINE('',{out.triple('CARTESIAN_POINT', at[key[0]])},{vector})")
        edges[key] = out(f"EDGE_CURVE('',{vertex[key[0]]},{vertex[key[1]]},{line},.T.)")
    return out(f"ORIENTED_EDGE('',*,*,{edges[key]},{'.T.' if key == ends else '.F.'})")


def step_box(size, origin, unit=".MILLI."):
    """Return the text; ``unit``: prefix of METRE, empty for none."""
    out, edges, faces = _Lines(), {}, []
    at = {k: [float(o + c * s) for o, c, s in zip(origin, k, size, strict=True)] for k in CORNERS}
    vertex = {k: out(f"VERTEX_POINT('',{out.triple('CARTESIAN_POINT', p)})") for k, p in at.items()}
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            loop = []
            for a, b in [(0, 0), (1, 0), (1, 1), (0, 1)][:: 1 if side else -1]:
                corner = [0, 0, 0]
                corner[axis], corner[u], corner[v] = side, a, b
                loop.append(tuple(corner))
            ends = zip(loop, [*loop[1:], loop[0]], strict=True)
            ring = ",".join(_edge(out, edges, at, pair, vertex) for pair in ends)
            edge_loop = out(f"EDGE_LOOP('',({ring}))")
            bound = out(f"FACE_OUTER_BOUND('',{edge_loop},.T.)")
            z, x = [0.0] * 3, [0.0] * 3
            z[axis], x[u] = (1.0 if side else -1.0), 1.0
            plane = out(f"PLANE('',{out.placement(at[loop[0]], z, x)})")
            faces.append(out(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
    shell = out(f"CLOSED_SHELL('',({','.join(faces)}))")
    solid = out(f"MANIFOLD_SOLID_BREP('box',{shell})")
    length = out(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({unit or '$'},.METRE.))")
    angle = out("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    space = out("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    context = out(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{space}))REPRESENTATION_CONTEXT('',''))"
    )
    frame = out.placement((0, 0, 0), (0, 0, 1), (1, 0, 0))
    shape = out(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({frame},{solid}),{context})")
    about = out("APPLICATION_CONTEXT('automotive design')")
    standard = "'international standard','automotive_design',2000"
    out(f"APPLICATION_PROTOCOL_DEFINITION({standard},{about})")
    field = out(f"PRODUCT_CONTEXT('',{about},'mechanical')")
    product = out(f"PRODUCT('box','box','',({field}))")
    version = out(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    stage = out(f"PRODUCT_DEFINITION_CONTEXT('part definition',{about},'design')")
    definition = out(f"PRODUCT_DEFINITION('design','',{version},{stage})")
    whole = out(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    out(f"SHAPE_DEFINITION_REPRESENTATION({whole},{shape})")
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
        "FILE_NAME('','2020-01-01T00:00:00',(''),(''),'','','');\n"
        "FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\nDATA;\n"
        + "\n".join(out.text)
        + "\nENDSEC;\nEND-ISO-10303-21;\n"
    )
