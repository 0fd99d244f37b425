"""Generates throng/v1 from the .proto files while the package is built."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = Path(__file__).resolve().parent


def proto_dir() -> Path:
    """The .proto files: carried inside a source archive, or the repository's."""
    for candidate in (HERE / "proto", HERE.parent.parent / "proto"):
        if (candidate / "throng" / "v1" / "ingest.proto").is_file():
            return candidate
    raise SystemExit("throng: proto/throng/v1 not found beside client/python or inside it")


class BuildWithStubs(build_py):
    def run(self) -> None:
        super().run()
        # An editable install is imported from here, any other from the build folder.
        target = HERE if getattr(self, "editable_mode", False) else Path(self.build_lib)
        generate(proto_dir(), target.resolve())


class SdistWithProto(sdist):
    def make_release_tree(self, base_dir, files) -> None:
        super().make_release_tree(base_dir, files)
        target = Path(base_dir) / "proto"
        if not target.exists():
            shutil.copytree(proto_dir() / "throng", target / "throng")


def generate(source: Path, target: Path) -> None:
    """Writes throng/v1/*_pb2.py, *_pb2.pyi and *_pb2_grpc.py below `target`."""
    import grpc_tools
    from grpc_tools import protoc

    (target / "throng" / "v1").mkdir(parents=True, exist_ok=True)
    protos = [str(path.relative_to(source)) for path in sorted((source / "throng" / "v1").glob("*.proto"))]
    well_known = Path(grpc_tools.__file__).parent / "_proto"
    arguments = ["protoc", f"-I{source}", f"-I{well_known}", f"--python_out={target}",
                 f"--pyi_out={target}", f"--grpc_python_out={target}", *protos]
    if protoc.main(arguments) != 0:
        raise SystemExit("throng: protoc failed, see above")


setup(cmdclass={"build_py": BuildWithStubs, "sdist": SdistWithProto})
