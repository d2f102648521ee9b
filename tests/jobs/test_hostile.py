"""Input without end or without sense: one line, soon, and no half-written cell."""

import os
import threading
import time

import pytest

from postproc import files
from postproc.cell.file import parse_cell
from postproc.cell.urdf import xacro
from postproc.errors import CellError, ReadError
from postproc.readers import read

HEAD = 'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'
APT = "UNITS/MM\nFEDRAT/500,MMPM\nGOTO/0,0,0\nGOTO/1,0,0\nFINI\n"


@pytest.mark.parametrize(
    "text",
    ["a" + ".a" * 100_000 + "=1", "[a" + '."b"' * 50_000 + "]", "x = {" + "a ." * 50_000 + "a=1}"],
)
def test_keys_of_many_parts(text):
    start = time.process_time()
    with pytest.raises(CellError, match=r"cell.toml:4: .*dotted key of more than 40 parts"):
        parse_cell(f"{HEAD}{text}\n".encode(), "cell.toml")
    assert time.process_time() - start < 2.0


def test_statements_that_go_on_without_end(tmp_path):
    file = tmp_path / "long.apt"
    for text in ("GOTO/1,$\n" + "2,$\n" * 2_000_000, "X$\n" * 40_000 + "FINI\n"):
        file.write_text(f"UNITS/MM\n{text}")
        start = time.process_time()
        with pytest.raises(ReadError, match=r"long.apt:2: error IO015"):
            read(file)
        assert time.process_time() - start < 5.0


@pytest.mark.slow
def test_expressions_of_xacro_without_end(tmp_path, monkeypatch):
    pytest.importorskip("xacrodoc")
    monkeypatch.setattr(xacro, "_SECONDS", 2)
    for expression in ("9**9**9", "[0]*10**11", "sum(range(10**12))", "'a'*10**9*10"):
        file = tmp_path / "arm.xacro"
        file.write_text(
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
            f'<link name="${{{expression}}}"/></robot>'
        )
        with pytest.raises(CellError, match=r"arm.xacro.*CEL011: xacro: "):
            xacro.expanded(file, tmp_path)


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "part.apt"
    os.mkfifo(path)
    return path


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_read_like_a_file(pipe):
    writer = threading.Thread(target=pipe.write_text, args=(APT,))
    writer.start()
    assert len(read(pipe)) == 2
    writer.join()
    assert files._SPOOLED == {}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_that_says_nothing_more_ends(pipe, monkeypatch):
    monkeypatch.setattr(files, "PIPE_SILENCE", 0.2)
    with pytest.raises(ReadError, match=r"part.apt.* IO016: a pipe from which nothing came"):
        read(pipe)
    with pytest.raises(ReadError, match="IO016"):
        files.read_bytes(pipe)
    handle = os.open(pipe, os.O_RDWR)
    os.write(handle, APT.encode())
    with pytest.raises(ReadError, match="IO016"):
        read(pipe)
    monkeypatch.setattr(files, "MOST_PIPED", 10)
    os.write(handle, APT.encode())
    with pytest.raises(ReadError, match="IO016: a pipe that says more than"):
        read(pipe)
    os.close(handle)
