"""Backups of controllers made for tests: text of the data lists, folders and ZIP archives."""

import io
import zipfile

FRAME = "XYZABC"
ARM = {
    "$TIRORO": (0, 0, 800, 0, 0, 0), "$TFLWP": (0, 0, 286, 0, 0, 0),
    "$TX3P3": (1039.5, 0, 150, 0, 90, 0),
}  # fmt: skip
LIMITS = ((-156.5, 148), (-130, 5), (-110, 162), (-124, 169), (-120, 120), (-350, 350))
HOME = (21.0886, -95.5, 101.25, 12.0, -33.5, 44.0)


def frame(values, lower=False):
    keys = FRAME.lower() if lower else FRAME
    return "{" + ",".join(f"{key} {value!r}" for key, value in zip(keys, values, strict=True)) + "}"


def axes(values, lower=False):
    letter = "a" if lower else "A"
    return "{" + ",".join(f"{letter}{i} {v!r}" for i, v in enumerate(values, 1)) + "}"


def machine(name="#KR500R2800_2 C4 FLR", root=(0.0,) * 6, extra=(), **changes):
    """The text of $machine.dat of a KR 500 R2800-2; ``changes``: lengths."""
    lengths = {"$LENGTH_A": 500.0, "$LENGTH_B": 1250.0, **{f"${k}": v for k, v in changes.items()}}
    lines = ["&ACCESS RV", "DEFDAT  $MACHINE PUBLIC", f'$TRAFONAME[]="{name}" ;NAME; = 32 SIGNS']
    lines += [f"FRAME $ROBROOT={frame(root)} ;ROBOT = ROOT", "INT $TRAFO_AXIS=6 ;AXES"]
    lines += ["DECL MAIN_AXIS $MAIN_AXIS=#NR", "DECL WRIST_AXIS $WRIST_AXIS=#ZEH"]
    lines += ["REAL $SOFTN_END[12]", "REAL $SOFTP_END[12]"]
    for axis, (low, high) in enumerate(LIMITS, 1):
        lines += [f"$SOFTN_END[{axis}]={low!r}", f"$SOFTP_END[{axis}]={high!r} ;[DEG]"]
    lines += [f"$RAT_MOT_AX[{axis}]={{N -200,D 1}}" for axis in range(1, 7)]
    lines += [f"$VEL_AXIS_MA[{axis}]=3000.0" for axis in range(1, 7)]
    lines += [f"FRAME {key}={frame(values)}" for key, values in ARM.items()]
    lines += [f"REAL {key}={value!r}" for key, value in lengths.items()]
    return "\r\n".join([*lines, "INT $EX_AX_NUM=0", *extra, "ENDDAT"])


def config(tools, bases, names=None, loads=None, kinds=None, home=HOME, extra=(), lower=False):
    """The text of $config.dat; tools, bases: number to frame."""
    lines = ["&ACCESS RV", "DEFDAT  $CONFIG", ";FOLD BASISTECH GLOBALS"]
    lines += ["ENUM IPO_M_T NONE,TCP,BASE", f"E6AXIS XHOME={axes(home, lower)}"]
    for what, count, frames in (("TOOL", 16, tools), ("BASE", 32, bases)):
        lines += [f"DECL FRAME {what}_DATA[{count}]", f"DECL CHAR {what}_NAME[{count},24]"]
        for n in range(1, count + 1):
            lines.append(f"{what}_DATA[{n}]={frame(frames.get(n, (0.0,) * 6), lower)}")
            lines.append(f'{what}_NAME[{n},]="{(names or {}).get((what, n), " ")}"')
            kind = (kinds or {}).get((what, n), "#BASE" if n in frames else "#NONE")
            lines.append(f"{what}_TYPE[{n}]={kind}")
    for n in range(1, 17):
        mass, cog = (loads or {}).get(n, (-1.0, (0.0,) * 3))
        lines.append(
            f"LOAD_DATA[{n}]={{M {mass!r},CM {frame((*cog, 0.0, 0.0, 0.0), lower)},"
            "J {X 0.0,Y 0.0,Z 0.0}}"
        )
    return "\r\n".join([*lines, *extra, ";ENDFOLD", "ENDDAT"])


INFO = "[Archive]\r\nName=e:\\cell.zip\\\r\nLastDisk=0\r\n[Roboter]\r\nRobName=ZELLE\r\n" \
       "IRSerialNr=42\r\n[Version]\r\nVersion=V8.6.5\r\n"  # fmt: skip


def files(machine_text, config_text, encoding="utf-8", **others):
    """The files of an archive of the controller, with the two decoys."""
    return {
        "am.ini": INFO.encode(),
        "KRC/STEU/Mada/$machine.dat": b"DEFDAT $MACHINE PUBLIC\nSIGNAL $T1 $OUT[84]\nENDDAT\n",
        "KRC/STEU/$config.dat": b"DEFDAT $CONFIG\nENDDAT\n",
        "KRC/R1/Mada/$machine.dat": machine_text.encode(encoding),
        "KRC/R1/System/$config.dat": config_text.encode(encoding),
        **{name: text.encode(encoding) for name, text in others.items()},
    }


def zipped(contents):
    """The bytes of a ZIP archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def unpacked(folder, contents):
    for name, content in contents.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder
