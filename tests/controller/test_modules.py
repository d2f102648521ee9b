"""Which files belong to a program: those beside it, and on a controller all by their names."""

import pytest

from postproc.controller import load_program

MAIN = "DEF MAIN( )\r\nHELPER()\r\nn = ANSWER(3)\r\nEND\r\n"


@pytest.fixture
def controller(tmp_path):
    """The folder R1 of a controller: files by their names in it."""

    def make(files):
        root = tmp_path / "KRC" / "R1"
        for name, text in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        return root / "Program" / "jobs" / "MAIN.src"

    return make


def names(path, **options):
    return [module.name.upper() for module in load_program(path, **options)]


FILES = {
    "Program/jobs/MAIN.src": MAIN,
    "Program/parts/Helper.src": "DEF HELPER( )\r\nDEEPER()\r\nEND\r\n",
    "Program/parts/deeper.src": "DEF DEEPER( )\r\nEND\r\n",
    "Program/answers.src": "DEF OTHER( )\r\nEND\r\n",
    "Program/Answer.src": "DEFFCT INT ANSWER(n:IN)\r\nINT n\r\nRETURN n\r\nENDFCT\r\n",
    "System/$config.dat": "DEFDAT $CONFIG PUBLIC\r\nDECL GLOBAL INT SPEED=3\r\nENDDAT\r\n",
    "Program/points.dat": "DEFDAT POINTS PUBLIC\r\nDECL GLOBAL REAL X1=3.0\r\nENDDAT\r\n",
}


def test_beside_it_there_is_nothing(controller):
    assert names(controller(FILES)) == ["MAIN"]


def test_on_a_controller_every_module_is_known_by_its_name(controller):
    found = names(controller(FILES), on_controller=True)
    assert sorted(found) == ["$CONFIG", "ANSWER", "DEEPER", "HELPER", "MAIN", "POINTS"]
    assert found[0] == "MAIN"


def test_what_two_files_may_be_is_neither(controller):
    files = {**FILES, "Program/old/helper.src": "DEF HELPER( )\r\nEND\r\n"}
    assert "HELPER" not in names(controller(files), on_controller=True)


def test_the_one_beside_the_program_comes_first(controller):
    files = {**FILES, "Program/jobs/helper.src": "DEF HELPER( )\r\nEND\r\n"}
    assert "DEEPER" not in names(controller(files), on_controller=True)


def test_a_broken_list_of_data_is_left_out(controller):
    files = {**FILES, "Program/points.dat": "DEFDAT POINTS PUBLIC\r\nDECL REAL X1=\r\n"}
    assert "POINTS" not in names(controller(files), on_controller=True)


@pytest.mark.parametrize("folder", ["System", "TP/Gripper"])
def test_routines_of_the_maker_are_not_followed(controller, folder):
    files = {name: text for name, text in FILES.items() if "Helper" not in name}
    files[f"{folder}/helper.src"] = "DEF HELPER( )\r\nEND\r\n"
    assert "HELPER" not in names(controller(files), on_controller=True)


def test_elsewhere_nothing_but_the_folder_is_looked_at(tmp_path):
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs" / "MAIN.src").write_text(MAIN)
    (tmp_path / "helper.src").write_text("DEF HELPER( )\r\nEND\r\n")
    assert names(tmp_path / "jobs" / "MAIN.src", on_controller=True) == ["MAIN"]


def test_a_global_routine_is_found_in_any_file(controller):
    shared = {
        "Program/jobs/mine.src": "DEF MINE( )\r\nEND\r\n global def helper( )\r\nEND\r\n",
        "Program/jobs/local.src": "DEF LOCAL( )\r\nEND\r\nDEF HELPER( )\r\nEND\r\n",
        "Program/sums.src": "DEF SUMS( )\r\nEND\r\nGLOBAL DEFFCT INT ANSWER(n:IN)\r\nENDFCT\r\n",
    }
    path = controller({"Program/jobs/MAIN.src": MAIN, **shared})
    assert names(path) == ["MAIN"]
    assert set(names(path, on_controller=True)) == {"MAIN", "MINE", "SUMS"}
