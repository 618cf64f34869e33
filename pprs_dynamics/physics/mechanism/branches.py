# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Branches of a robot's tree: which link stands, which carries the load, what moves between."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pprs_dynamics.physics.mechanism.description import FIXED, FLOATING, Description, Joint

# What links at the end of an arm are called, the likeliest first.
TOOLS = ('tool0', 'tcp', 'tool', 'ee_link', 'end_effector', 'flange', 'ee', 'hand', 'gripper')
GRIPPER = 2  # joints beyond a flange that may be fingers


@dataclass(frozen=True)
class Branch:
    """Chain of joints from the base to a link.

    Parameters
    ----------
    tool : str
    joints : tuple of Joint
        Those that move and follow no other, from the base on.
    """

    tool: str
    joints: tuple[Joint, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)


def root_of(description: Description) -> str:
    """Return the link that hangs on none, or what hangs on it by a floating joint."""
    on_root = [joint for joint in description.joints.values() if joint.parent == description.root]
    is_carried = len(on_root) == 1 and on_root[0].kind == FLOATING
    return on_root[0].child if is_carried else description.root


def branch_to(description: Description, tool: str) -> Branch:
    """Return the chain between the base and a link."""
    joints: list[Joint] = []
    link = tool
    while link in description.hung:
        joint = description.hung[link]
        if joint.kind not in (FIXED, FLOATING) and joint.mimic is None:
            joints.append(joint)
        link = joint.parent
    return Branch(tool, tuple(reversed(joints)))


def likely_branches(description: Description, recorded: Collection[str] = ()) -> list[Branch]:
    """Return the branches to the likely tools, best first; several that move alike are one.

    Parameters
    ----------
    description : Description
    recorded : collection of str
        Joints of which there are recordings: a branch with more of them is likelier.
    """
    parents = {joint.parent for joint in description.joints.values()}
    leaves = [link for link in description.links if link not in parents]
    named = [link for link in description.links if _rank(link) < len(TOOLS)]
    closed = {link for loop in description.loops for link in (loop.a, loop.b)}
    found = [branch_to(description, link) for link in dict.fromkeys((*leaves, *named, *closed))]
    longest = max((len(branch.joints) for branch in found), default=0)

    def worth(branch: Branch) -> tuple[int, ...]:
        own = len({*branch.names} & {*recorded})
        # A platform closes the most loops; a flange has fingers beyond it.
        loops = sum(branch.tool in (loop.a, loop.b) for loop in description.loops)
        is_tool = _rank(branch.tool) < len(TOOLS) and len(branch.joints) >= longest - GRIPPER
        missing = sum(name not in recorded for name in branch.names) if recorded else 0
        return (own, loops if loops > 1 else 0, -missing, int(is_tool), len(branch.joints),
                -_rank(branch.tool))

    best: dict[tuple[str, ...], Branch] = {}
    for branch in sorted(found, key=worth, reverse=True):
        best.setdefault(branch.names, branch)
    return list(best.values())


def as_likely(description: Description, recorded: Collection[str] = ()) -> list[Branch]:
    """Return the best branch, and others as long that move by other joints."""
    first, *others = likely_branches(description, recorded) or [Branch(root_of(description), ())]
    own = {*first.names}
    return [first, *(branch for branch in others if len(branch.joints) >= len(first.joints)
                     and not own & {*branch.names} and len({*branch.names} & {*recorded})
                     >= len(own & {*recorded}) and not description.loops)]


def _rank(link: str) -> int:
    """Return the rank of a link's name among names of tools; their number for none."""
    name = link.lower()
    return next((k for k, tool in enumerate(TOOLS) if name == tool or name.endswith(
        (f'_{tool}', f'-{tool}')) or (tool in ('tool0', 'tcp', 'flange') and tool in name)),
        len(TOOLS))
