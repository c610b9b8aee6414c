"""Which build this is, and where its programs are."""
import dataclasses
import os
import platform
import shutil

from sweep.failure import Failure, INPUT

TOOL = "vox-sweep"


@dataclasses.dataclass(frozen=True)
class Build:
    version: str
    commit: str
    cuda: bool
    folder: str  # of the programs

    def text(self):
        """As every program's --version, without its name."""
        python = f"{platform.python_implementation()} {platform.python_version()}"
        return f"{self.version} ({self.commit}, {python}, scalar, cuda {'yes' if self.cuda else 'no'})"

    def program(self, name):
        """The path of another program of ours: beside this one, or where the shell finds it."""
        beside = os.path.join(self.folder, name)
        if os.access(beside, os.X_OK):
            return beside
        found = shutil.which(name)
        if found is None:
            raise Failure(INPUT, "is not installed: expected it beside vox-sweep", name)
        return found
