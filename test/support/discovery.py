# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How DDS finds and forgets processes in tests: over UDP, and soon when one was killed."""

from __future__ import annotations

from pathlib import Path

# After the last sign of life [s]; Fast DDS waits 20 s otherwise, as long as all else a test does.
LEASE = 4
PROFILE = f'''<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com"><profiles>
<participant profile_name="tests" is_default_profile="true"><rtps><builtin><discovery_config>
<leaseDuration><sec>{LEASE}</sec></leaseDuration>
<leaseAnnouncement><sec>1</sec></leaseAnnouncement>
</discovery_config></builtin></rtps></participant>
</profiles></dds>
'''


def in_a_hurry(folder: str) -> dict[str, str]:
    """Write the profile; return the environment in which participants have it."""
    file = Path(folder) / 'discovery.xml'
    file.write_text(PROFILE)
    # Shared memory is one for all domains and containers that run side by side.
    return {'FASTDDS_DEFAULT_PROFILES_FILE': str(file), 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
