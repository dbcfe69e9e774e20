"""`dior verify`: is a release, its exports or a tarball whole, unchanged and consistent in itself.

INPUTS   a release folder, an exports folder, or tarballs, which are read without being unpacked; those of one release
         that are given together are looked at together
OUTPUT   a line per problem, or one that says what was looked at; exit code 1 where there is a problem

1. Nothing is missing or too many, and every checksum is right (checksums.py).
2. Every table has the columns, types and words of `dior.tables.schemas`, and a row for each (frame, joint); labels lie
   in frames that there are, pictures have their size (walk_checks.py).
3. Cameras, walks and people that a table names are there, splits refer to recordings, the card's counts are the tables'
   (release_checks.py). A subject's tarball alone has nothing of that.
A file whose checksum is wrong is not looked into. Walks are looked at two at a time; memory is that of a few tables.
"""

from collections import Counter
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dior.errors import DiorError, many
from dior.progress import reporting
from dior.release import checksums

if TYPE_CHECKING:
    from dior.arrays import Table
    from dior.release.verify.evidence import Setup
    from dior.release.verify.folder_or_tarball import File, Tarball
    from dior.release.verify.walk_checks import Problem, WalkFindings

# folders that a release has and exports do not
OF_RELEASE = ("labels_2d", "skeletons_3d", checksums.FOLDER)


@dataclass
class Stored:
    """Files of a release, or of exports, in one place or in several tarballs.

    `listed`: SHA-256 by path of what should be there; `problems`: (path, sentence).
    """

    name: str
    parts: set[str]
    files: "dict[str, File]" = field(default_factory=dict)
    listed: dict[str, str] = field(default_factory=dict)
    problems: "list[Problem]" = field(default_factory=list)

    @property
    def whole(self) -> bool:
        return checksums.METADATA in self.parts and {checksums.of_whom(name) for name in self.listed} <= self.parts


def run(
    paths: list[Path] | None = None, *, key: Path | None = None, decode: bool = False, inputs: Path | None = None
) -> None:
    """Print what is wrong with releases, or with the recordings of a project.

    `paths`: release folder, exports folder, tarballs; `key`: whose signature it must bear, an allowed-signers file or
    public keys; `decode`: decode every picture, not only read its header; `inputs`: folder of a project, whose
    recordings are hashed whole and compared with what its release was made from.

    Raises DiorError where something is wrong, after all of it was printed.
    """
    if not paths and inputs is None:
        raise DiorError("name a release folder, an exports folder or tarballs, or a project with --inputs")
    if key is not None:
        from dior.release import signature

        signature.allowed_signers(key)
    wrong = _print_inputs(inputs) if inputs else 0
    for stored in _stored(paths or []):
        problems, summary = _looked_at(stored, decode)
        wrong_signature, signed = _signature(stored, key)
        problems += wrong_signature
        summary += signed
        for path, text in sorted(problems):
            print(f"{stored.name}/{path}: {text}" if path else f"{stored.name}: {text}")
        wrong += len(problems)
        if not problems:
            print(f"{stored.name}: {summary}")
    if wrong:
        raise DiorError(many(wrong, "problem"))


def _print_inputs(project: Path) -> int:
    """Print what is wrong with a project's recordings; returns how many are."""
    from dior.release.verify import recordings

    problems, count = recordings.problems(project)
    print("\n".join(problems) if problems else f"{project}: {count} recordings are what the labels were made from")
    return len(problems)


def _stored(paths: list[Path]) -> list[Stored]:
    """`Stored`s: one for each folder, and one for all tarballs of a release."""
    from dior.release.verify import folder_or_tarball

    found: list[Stored] = []
    tarballs: dict[str, list[tuple[Path, Tarball]]] = {}
    for path in paths:
        if path.is_dir():
            found.append(_of_folder(path))
        elif path.is_file():
            tarball = folder_or_tarball.of_tarball(path)
            tarballs.setdefault(tarball.release, []).append((path, tarball))
        else:
            raise DiorError(f"{path}: there is no such folder or tarball")
    return found + [_of_tarballs(release, members) for release, members in tarballs.items()]


def _of_folder(folder: Path) -> Stored:
    from dior.release.verify import folder_or_tarball

    files, problems = folder_or_tarball.of_folder(folder)
    found = Stored(folder.resolve().name, set(), files, {}, [("", text) for text in problems])
    if checksums.SUMS not in files:
        raise DiorError(
            f"{folder}: has no {checksums.SUMS}, so that it is no release, or the list was lost; get it again"
        )
    found.listed = _list(found, checksums.SUMS)
    of_release = any(name.split("/")[0] in OF_RELEASE for name in (*files, *found.listed))
    found.parts = {checksums.METADATA, *(checksums.of_whom(name) for name in found.listed)} if of_release else set()
    _compare(found, files, found.listed.keys() | {checksums.SUMS}, "")
    return found


def _of_tarballs(release: str, members: "list[tuple[Path, Tarball]]") -> Stored:
    found = Stored(release, {tarball.part for _, tarball in members})
    for path, tarball in members:
        first = checksums.list_of(tarball.part)
        found.problems += [("", f"{path}: {text}") for text in tarball.problems]
        twice = sorted(found.files.keys() & tarball.files.keys())
        found.problems += [(name, f"is in {path} and in another tarball that was given") for name in twice]
        found.files |= tarball.files
        listed = _list(found, first) if first in tarball.files else {}
        own = {name: digest for name, digest in listed.items() if checksums.of_whom(name) == tarball.part}
        _compare(found, tarball.files, own.keys() | {first}, f" of {path}")
        found.listed |= (
            listed if tarball.part == checksums.METADATA else {n: d for n, d in own.items() if n not in found.listed}
        )
    return found


def _list(found: Stored, path: str) -> dict[str, str]:
    """The list of checksums at `path`; what is wrong with it becomes a problem."""
    listed, problems = checksums.parsed(found.files[path].read())
    found.problems += [(path, text) for text in problems]
    return listed


def _compare(found: Stored, files: "dict[str, File]", expected: Collection[str], where: str) -> None:
    found.problems += [(name, f"is missing{where}") for name in sorted(expected - files.keys())]
    extra = files.keys() - expected - ({checksums.SIGNATURE} if checksums.SUMS in expected else set())
    found.problems += [(name, f"should not be in the files{where}") for name in sorted(extra)]


def _looked_at(stored: Stored, decode: bool) -> "tuple[list[Problem], str]":
    """(problems, what was looked at as a sentence)."""
    problems = list(stored.problems)
    version = _version(stored)
    n_files, size = len(stored.files), sum(file.size for file in stored.files.values())
    summary = f"{n_files} files, {size / 1e9:.2f} GB, checksums right"
    rig: Setup | None = None
    about: dict[str, Table] = {}
    good: dict[str, File] = {}
    walks: list[WalkFindings] = []
    groups = _groups(stored)
    with ThreadPoolExecutor(checksums.THREADS) as pool:
        alone, together = ([names for group, names in groups.items() if (len(group) > 1) == many] for many in (0, 1))
        for wrong, intact in pool.map(lambda names: _intact(stored, names), alone):
            problems += wrong
            good |= intact
        if checksums.METADATA in stored.parts and not version:
            from dior.release.verify import evidence, release_checks

            top = {name: file for name, file in good.items() if "/" not in name}
            about, wrong = release_checks.about(top, stored.listed.keys(), stored.listed)
            problems += wrong
            # what is wrong in these tables is wrong in all that is computed with them
            rig = None if wrong else evidence.rig(about, evidence.provenance(top))
        looked = pool.map(lambda names: _walk(stored, names, decode, not version, rig), together)
        for wrong, intact, walk in reporting(looked, len(together), "walks" if stored.parts else "files", stored.name):
            problems += wrong
            good |= intact
            if walk:
                walks.append(walk)
                problems += walk.problems
    if not stored.parts or version:
        return problems + version, summary
    problems += _complete(stored)
    if checksums.METADATA in stored.parts:
        from dior.release.verify import head_checks

        problems += _lists_agree(stored, good) + release_checks.sizes(walks, about) + head_checks.problems(good, about)
        if stored.whole and not problems and rig:
            from dior.release.verify import checks

            problems += checks.of_release(evidence.Evidence(good, about, walks, evidence.provenance(good), rig))
    problems += [problem for walk in walks for problem in walk.bare]
    return problems, f"{summary}; {_counted(stored, walks, decode)}"


def _signature(stored: Stored, key: Path | None) -> "tuple[list[Problem], str]":
    """(problems, what is known of the signature as the end of a sentence)."""
    from dior.release import signature

    path, files = checksums.SIGNATURE, stored.files
    if path not in files or checksums.SUMS not in files:
        if key is None:
            return [], "; not signed, so that what was changed consistently is not found" if stored.parts else ""
        whole = checksums.METADATA in stored.parts
        why = "its lab has not signed it, or the signature was lost; ask them for it"
        other = (
            f"is in the tarball of {checksums.METADATA}; give that, too"
            if stored.parts
            else ("exports are not signed; verify the release that they were made of")
        )
        return [(path, f"is missing: {why if whole else other}")], ""
    content, armoured = files[checksums.SUMS].read(), files[path].read()
    if key is None and not signature.can_check():
        return [], "; signed, which nobody can check without ssh-keygen"
    try:
        if key is None:
            return (
                [],
                f"; signed with {signature.signer(content, armoured)}, --key <the lab's public key> checks whose",
            )
        return [], f"; signed by {signature.checked(content, armoured, key)}"
    except DiorError as error:
        return [(path, str(error))], ""


def _version(stored: Stored) -> "list[Problem]":
    """One problem where the tables are of a version that this dior does not know, so that it cannot look into them."""
    from dior.release import layout

    table = next((file for name, file in sorted(stored.files.items()) if name.endswith(".parquet")), None)
    wrong = layout.of_other_version(table.open()) if table and stored.parts else ""
    return [("", wrong)] if wrong else []


def _groups(stored: Stored) -> dict[tuple[str, ...], list[str]]:
    """Paths by (subject, walk), and by themselves where they are about no walk."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in sorted(stored.files):
        parts = name.split("/")
        about_walk = stored.parts and len(parts) == 3 and parts[0] != checksums.FOLDER
        groups.setdefault((parts[1], parts[2].split(".")[0]) if about_walk else (name,), []).append(name)
    return groups


def _intact(stored: Stored, names: list[str]) -> "tuple[list[Problem], dict[str, File]]":
    """(problems, files whose checksum is right) of some files."""
    good: dict[str, File] = {}
    problems: list[Problem] = []
    for name in names:
        file, expected = stored.files[name], stored.listed.get(name)
        if expected is None:
            # too many, which is a problem already, or the list of all files itself
            good |= {name: file} if name == checksums.SUMS else {}
            continue
        if checksums.digest(file.open()) == expected:
            good[name] = file
        else:
            problems.append(
                (name, "its SHA-256 is not the listed one: damaged, changed or of another build; get it again")
            )
    return problems, good


def _walk(
    stored: Stored, names: list[str], decode: bool, look_inside: bool, rig: "Setup | None"
) -> "tuple[list[Problem], dict[str, File], WalkFindings | None]":
    """(problems, files whose checksum is right, what was found in them or None) of the files of one walk."""
    problems, good = _intact(stored, names)
    if not look_inside:
        return problems, good, None
    from dior.release.verify import checks, walk_checks

    listed = [name for name in names if name in stored.listed]
    intact = {name: good[name] for name in listed if name in good}
    _, who, file = names[0].split("/")
    found = walk_checks.walk(who, file.split(".")[0], intact, listed, decode)
    if rig and not problems and not found.problems:
        checks.of_walk(found, intact, rig, decode)
    found.tables.clear()
    found.pictures.clear()
    return problems, good, found


def _lists_agree(stored: Stored, good: "dict[str, File]") -> "list[Problem]":
    """A subject's list must be the part of the whole list that is about its files."""
    problems = []
    for who in sorted(stored.parts - {checksums.METADATA}):
        path = checksums.list_of(who)
        mine = {name: d for name, d in stored.listed.items() if checksums.of_whom(name) == who and name != path}
        if path in good and good[path].read() != checksums.text(mine).encode():
            problems.append((path, f"is not the part of {checksums.SUMS} that is about {who}"))
    return problems


def _complete(stored: Stored) -> "list[Problem]":
    """Every walk has its 3D, and every recording of a camera its labels and its frames."""
    names, problems = stored.listed.keys(), []
    for name in sorted(names):
        if name.count("/") not in (0, 2):
            problems.append((name, "lies where a release has no files"))
    recordings = sorted({n.split("/", 1)[1] for n in names if n.startswith(("labels_2d/", "frames/"))})
    for recording in recordings:
        walk = f"{recording.removesuffix('.parquet').rsplit('.', 1)[0]}.parquet"
        for needed in (f"labels_2d/{recording}", f"frames/{recording}", f"skeletons_3d/{walk}"):
            if needed not in names:
                problems.append((needed, "is not in the release, which has other tables of that walk"))
    return sorted(set(problems))


def _counted(stored: Stored, walks: "list[WalkFindings]", decode: bool) -> str:
    total: Counter[str] = Counter()
    for walk in walks:
        for counts in walk.counts.values():
            total.update(counts)
    people = len({walk.who for walk in walks})
    tables = sum(name.endswith(".parquet") for name in stored.files)
    looked = "decoded" if decode else "headers read"
    parts = [f"{tables} tables, {people} subjects, {len(walks)} walks, {total['camera_recordings']} recordings"]
    parts.append(f"{total['labels']} labels on {total['frames']} frames")
    parts.append(f"{total['points_3d']} points in 3D, {total['pictures']} pictures ({looked})")
    if not stored.whole:
        parts.append("not all of the release was given")
    return "; ".join(parts)
