"""Manual pages and shell completion are made from the programs' own --help."""

import re
import shutil
import subprocess

import pytest
from conftest import BUILD, ROOT

SUBCOMMANDS = "publish record snapshot watch crowds remove info convert doctor inspect export report sheet".split()
COMPLETION = ROOT / "deploy/completion/throng.bash"


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    if shutil.which("help2man") is None:
        pytest.skip("help2man is not installed")
    folder = tmp_path_factory.mktemp("man")
    subprocess.run([ROOT / "deploy/manual", BUILD / "bin", folder], check=True)
    return folder


def test_every_option_of_every_program_is_in_its_page(pages):
    found = sorted(path.stem for path in pages.iterdir())
    assert {"throng", "throng-server", "throng-render", "throng-bake", "throng-publish"} <= set(found)
    for name in found:
        program, _, subcommand = name.partition("-") if name.startswith("throng-") else (name, "", "")
        command = [name] if (BUILD / "bin" / name).exists() else None
        if command is None:
            parent = max((p for p in ("throng", "throng-bake") if name.startswith(p + "-")), key=len)
            command = [parent, name[len(parent) + 1:]]
        text = subprocess.run([BUILD / "bin" / command[0], *command[1:], "--help"], capture_output=True, text=True).stdout
        page = (pages / f"{name}.1").read_text().replace("\\-", "-")
        options = re.findall(r"^  (?:-\w,)?(--[\w-]+)", text, re.MULTILINE)
        assert options and all(option in page for option in options), name
        assert ".SH NAME" in page


def commands():
    """Every program and subcommand that was built, and its --help."""
    for path in sorted((BUILD / "bin").glob("throng*")):
        text = subprocess.run([path, "--help"], capture_output=True, text=True, check=True).stdout
        yield path.name, text
        subcommands = text.split("Subcommands:")[1].split("Examples:")[0] if "Subcommands:" in text else ""
        for name in re.findall(r"^  ([a-z][\w-]*) ", subcommands, re.MULTILINE):
            yield f"{path.name} {name}", subprocess.run([path, name, "--help"], capture_output=True, text=True, check=True).stdout


def test_every_flag_has_an_example_and_examples_have_no_other():
    for command, text in commands():
        if command.startswith("throng-bench"):
            continue  # its page has the published experiments' names
        options, _, examples = text.partition("Examples:\n")
        examples = examples.split("Exit codes:")[0]
        flags = re.findall(r"^  (?:(-\w),)?(--[\w-]+)", options, re.MULTILINE)
        assert flags, command
        known = {"--help", "--version"} | {flag for pair in flags for flag in pair}
        if command.startswith("throng "):
            known |= {"--quiet", "--server", "--ca-file", "--token-file"}
        lacks = [flag for short, flag in flags if flag not in ("--help", "--version")
                 and not re.search(rf"(?<![\w-])({flag}{f'|{short}' if short else ''})(?![\w-])", examples)]
        assert lacks == [], f"{command} --help shows no example of these"
        shown = [line for line in examples.replace("\\\n", " ").splitlines()
                 if re.match(rf"\s+{command} (?!{'|'.join(SUBCOMMANDS)})", line)]
        if command != "throng":  # its own flags come before a subcommand's
            assert [word for line in shown for word in re.findall(r"(?<=\s)--[\w-]+", line.split(" | ")[0])
                    if word not in known] == [], command


def test_what_a_script_reads_comes_as_json():
    text = dict(commands())
    for command in ("throng crowds", "throng remove", "throng info", "throng doctor", "throng-bake inspect", "throng-bake report",
                    "throng-server"):
        assert "--json" in text[command], command
    if "throng-view" in text:
        assert "--json" in text["throng-view"]
    assert "--stats" in text["throng-render"]


def test_completion_knows_every_flag_of_every_command():
    for command, text in commands():
        options = text.partition("Examples:")[0]
        flags = re.findall(r"^  (?:-\w,)?(--[\w-]+)", options, re.MULTILINE)
        assert set(flags) <= set(complete(*command.split(), "--")), command


def test_every_subcommand_of_throng_shows_examples_with_its_name(program):
    names = re.findall(r"^  ([a-z]+) ", program("throng", "--help").stdout.split("Subcommands:")[1].split("Examples:")[0], re.MULTILINE)
    assert len(names) >= 8
    for name in names:
        text = program("throng", name, "--help").stdout
        assert f"Examples:\n  throng {name}" in text, name


def complete(*words):
    quoted = " ".join(f"'{word}'" for word in words)
    script = f"""source {COMPLETION}; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}
        _throng '{BUILD}/bin/{words[0]}'; printf '%s\\n' "${{COMPREPLY[@]}}" """
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split()


def test_completion_offers_subcommands_options_and_words():
    assert complete("throng", "re") == ["record", "remove"]
    assert "--source-fps" in complete("throng", "publish", "--so")
    assert "--crowd" not in complete("throng", "--cr")
    assert complete("throng-render", "--raster", "vi") == ["visibility"]
    assert complete("throng-server", "--listen", "") == []
