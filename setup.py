# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

import subprocess
import sys
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.install import install

package_name = 'pprs_dynamics'
# Version, people and addresses are in package.xml only.
DESCRIPTION = ElementTree.parse(Path(__file__).with_name('package.xml')).getroot()
MAINTAINER = DESCRIPTION.find('maintainer')


class InstallCompiled(install):
    """Installs, and compiles the equations.

    As `colcon build` does it. pip runs this in a folder that it packs into a wheel, where nothing
    can be left: the nodes compile at their first start then, while they answer already.
    """

    def run(self):
        super().run()
        if self.root is None:
            # An installation that cannot compile is one without compiled kernels, no failure.
            subprocess.run([sys.executable, '-m', 'pprs_dynamics.physics.model.preparation'],
                           cwd=self.install_lib, check=False, stderr=subprocess.DEVNULL)


setup(
    name=package_name,
    version=DESCRIPTION.findtext('version'),
    description=DESCRIPTION.findtext('description'),
    license=DESCRIPTION.findtext('license'),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    project_urls={url.get('type'): url.text for url in DESCRIPTION.findall('url')},
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['py.typed', '__init__.pyi', 'config/*.yaml', 'config/*.urdf',
                                 'app/browser/*', 'app/report/plotly-basic.*',
                                 'app/report/uplot.*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/config', glob('config/*.yaml') + glob('config/*.urdf')),
        (f'share/{package_name}/config/ros2_control', glob('config/ros2_control/*.yaml')),
        (f'share/{package_name}/config/sros2', glob('config/sros2/*.xml')),
        (f'share/{package_name}/config/schemas', glob('config/schemas/*.json')),
        (f'share/{package_name}/config/plotjuggler', glob('config/plotjuggler/*.xml')),
        (f'share/{package_name}/config/foxglove', glob('config/foxglove/*.json')),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
    ],
    python_requires='>=3.11',
    install_requires=['setuptools', 'numpy>=1.26', 'scipy>=1.11', 'numba>=0.58', 'pandas>=2.1',
                      'python-dateutil>=2.8', 'PyYAML>=6'],
    extras_require={
        # ROS 2 as wheels, for machines where no ROS 2 is installed and sourced.
        'ros': ['ros-rclpy[fastrtps]==9.1.2', 'ros-std-msgs==5.5.1',
                'ros-sensor-msgs==5.5.1', 'ros-trajectory-msgs==5.5.1',
                'ros-diagnostic-msgs==5.5.1', 'ros-std-srvs==5.5.1'],
        # The terminal, its completion, pictures, pages.
        'report': ['rich>=13', 'argcomplete>=3', 'matplotlib>=3.8', 'plotly>=5.20'],
        'sim': ['mujoco>=4.0'],
        'bags': ['rosbags>=0.11'],
        'fleet': ['distributed>=2025.1', 'pyarrow>=17', 'ruptures>=1.1.9'],
        # Tables by columns of the model file: pyarrow reads Parquet.
        'tables': ['pyarrow>=17'],
        'workbench': ['starlette>=0.40', 'uvicorn>=0.30'],
        # Results in a notebook: pictures, and what the terminal shows.
        'notebook': ['rich>=13', 'matplotlib>=3.8'],
        # The site of the documentation: Markdown and notebooks, in a theme that reads on a phone.
        'docs': ['sphinx>=8', 'furo>=2024.8', 'myst-nb>=1.1', 'matplotlib>=3.8'],
        # Peers of the naming benchmark: LASSO, group LASSO, sparse identification of dynamics.
        'naming': ['scikit-learn>=1.5', 'skglm>=0.4', 'pysindy>=2.0'],
        'test': ['pytest>=8', 'pytest-xdist>=3.5', 'pytest-timeout>=2.3', 'hypothesis>=6',
                 'mujoco>=4.0', 'pin>=3',
                 'playwright>=1.45', 'ruff>=0.6', 'mypy>=1.11',
                 'axe-playwright-python>=0.1.4',  # accessibility of pages
                 'jsonschema>=4',  # ~/status against its schema
                 'types-PyYAML', 'scipy-stubs', 'sphinx>=8', 'furo>=2024.8', 'myst-nb>=1.1',
                 'colcon-common-extensions', 'colcon-ros',
                 # As `colcon test`; its wheel asks for a flake8 that ends with Python 3.11
                 'ament-lint-flake8>=0.14; python_version < "3.12"', 'ament-lint-pep257>=0.14',
                 'ros-test-msgs==2.3.0',  # an action, which the wheels of `ros` have none of
                 # colcon build --symlink-install calls `setup.py develop`, gone from 80 on.
                 'setuptools<80'],
    },
    zip_safe=False,
    cmdclass={'install': InstallCompiled},
    entry_points={
        'console_scripts': [
            'feedforward = pprs_dynamics.ros.executables:feedforward',
            'monitor = pprs_dynamics.ros.executables:monitor',
            'play_trajectory = pprs_dynamics.ros.executables:play_trajectory',
            'simulated_robot = pprs_dynamics.ros.executables:simulated_robot',
            'trajectory_proxy = pprs_dynamics.ros.executables:trajectory_proxy',
            'pprs = pprs_dynamics.app.commands.pprs:main',
        ],
    },
)
