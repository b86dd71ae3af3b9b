"""A model's plant as a functional mock-up unit: FMI 3.0 or 2.0 co-simulation around its C."""

import hashlib
import io
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from pma_gym.export.c_plant import CPlant, ExportError, Variable, si_unit, template
from pma_gym.units import SI_FACTORS

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
"""Of the compiler; without contraction sums are rounded as they are in Python."""

PLATFORMS = {2: "linux64", 3: "x86_64-linux"}
"""Folder of the binary, by version of FMI."""

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of the files in the unit, so that the same model gives the same bytes."""


def fmu_bytes(plant: CPlant, version: int = 3) -> bytes:
    """Build the unit: description, binary for 64-bit Linux, sources.

    Args:
        plant: the plant.
        version: of FMI, 2 or 3.
    Returns:
        The content of the .fmu file; the same for the same plant and compiler.
    Raises:
        ExportError: there is no C compiler, or the machine is no 64-bit Linux on x86.
    """
    plain = plant.files()
    token = hashlib.sha256("".join(plain.values()).encode()).hexdigest()[:32]
    wrapper = template("fmi.c").substitute(
        name=plant.name, fmi=version, token=token, command=plant.command
    )
    sources = {**plain, "fmi.c": wrapper}
    compiled = [name for name in sources if name.endswith(".c")]
    members = {f"sources/{name}": text.encode() for name, text in sources.items()}
    members["modelDescription.xml"] = _xml(_description(plant, version, token, compiled))
    if version == 3:
        members["sources/buildDescription.xml"] = _xml(_build_description(plant.name, compiled))
    binary = shared_library(sources, compiled)
    members[f"binaries/{PLATFORMS[version]}/{plant.name}.so"] = binary
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(members):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), members[name], zipfile.ZIP_DEFLATED)
    return written.getvalue()


def shared_library(sources: dict[str, str], compiled: Sequence[str]) -> bytes:
    """Compile C to a shared library of this machine.

    Args:
        sources: texts by file name.
        compiled: names of those that are compiled; the others are included.
    """
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    machine = f"{platform.system()} on {platform.machine()}"
    if compiler is None or machine != "Linux on x86_64":
        raise ExportError(
            f"an FMU needs a C compiler (cc, gcc or clang) on 64-bit Linux, this is {machine} with "
            f"{compiler or 'none'}; install gcc, or take --to c, which needs none"
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        out = Path(folder, "library.so")
        command = [compiler, *FLAGS, "-fPIC", "-shared", "-s", "-o", str(out), *compiled, "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        return out.read_bytes()


def _xml(root: Element) -> bytes:
    indent(root)
    return tostring(root, "utf-8", xml_declaration=True)


def _description(plant: CPlant, version: int, token: str, sources: Sequence[str]) -> Element:
    head = {"fmiVersion": f"{version}.0", "modelName": plant.model.name}
    head |= {"description": plant.model.title, "generationTool": "pma-gym"}
    head["instantiationToken" if version == 3 else "guid"] = token
    root = Element("fmiModelDescription", head)
    identity = {"modelIdentifier": plant.name, "canHandleVariableCommunicationStepSize": "true"}
    identity |= {"canInterpolateInputs": "true"} if version == 2 else {}
    kind = SubElement(root, "CoSimulation", identity)
    variables = list(_variables(plant))
    _write_units(SubElement(root, "UnitDefinitions"), [each for each, _ in variables])
    if version == 2:
        files = SubElement(kind, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize="0.001")
    listed, structure = SubElement(root, "ModelVariables"), Element("ModelStructure")
    outputs = Element("Outputs") if version == 2 else structure
    unknowns = Element("InitialUnknowns") if version == 2 else structure
    for reference, (variable, attributes) in enumerate(variables):
        entry = {"name": variable.name, "valueReference": str(reference), **attributes}
        real = {"unit": si_unit(variable.unit)} if variable.unit else {}
        if SI_FACTORS.get(variable.unit, 1.0) != 1.0:
            real["displayUnit"] = variable.unit
        if attributes["causality"] not in ("output", "independent"):
            real["start"] = repr(variable.value)
        if version == 3:
            SubElement(listed, "Float64", entry | real)
        else:
            SubElement(SubElement(listed, "ScalarVariable", entry), "Real", real)
        if attributes["causality"] == "output":
            place = {"index": str(reference + 1)} if version == 2 else {}
            place |= {"valueReference": str(reference)} if version == 3 else {}
            SubElement(outputs, "Output" if version == 3 else "Unknown", place)
    for output in list(outputs):
        SubElement(unknowns, "InitialUnknown" if version == 3 else "Unknown", output.attrib)
    if version == 2:
        structure.extend([outputs, unknowns])
    root.append(structure)
    return root


def _variables(plant: CPlant) -> list[tuple[Variable, dict[str, str]]]:
    """The numbers of an instance in `fmi.c`, in its order, with what FMI calls them."""
    moving = {"variability": "continuous"}
    exact = {"causality": "parameter", "variability": "tunable", "initial": "exact"}
    states = [Variable(f"state.{each.name}", each.unit, each.value) for each in plant.states]
    return [
        (Variable("time", "s"), {"causality": "independent", **moving}),
        *((each, {"causality": "input", **moving}) for each in plant.commands),
        *((each, {"causality": "output", **moving}) for each in plant.readings),
        *((each, exact) for each in plant.parameters),
        *((each, {**exact, "causality": "local", **moving}) for each in states),
        (Variable("zero_contraction", "m", plant.zero), exact),
    ]


def _write_units(root: Element, variables: Sequence[Variable]) -> None:
    """SI units, each with the units in which files have it."""
    files = sorted({each.unit for each in variables if each.unit})
    for unit in sorted(set(map(si_unit, files))):
        entry = SubElement(root, "Unit", name=unit)
        for shown in files:
            if si_unit(shown) == unit and SI_FACTORS[shown] != 1.0:
                SubElement(entry, "DisplayUnit", name=shown, factor=repr(1.0 / SI_FACTORS[shown]))


def _build_description(name: str, sources: Sequence[str]) -> Element:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(build, "SourceFileSet", language="C99", compilerOptions=FLAGS[-1])
    for source in sources:
        SubElement(files, "SourceFile", name=source)
    SubElement(build, "Library", name="m")
    return root
