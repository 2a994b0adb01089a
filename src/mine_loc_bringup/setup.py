from setuptools import find_packages, setup

setup(
    name="mine_loc_bringup",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_bringup": ["py.typed", "graph.yaml", "fast_discovery.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_bringup"]),
        ("share/mine_loc_bringup", ["package.xml"]),
        ("share/mine_loc_bringup/launch", ["launch/mine_loc.launch.py"]),
    ],
    description="The node graph, launch files and the mine-loc command.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["mine-loc = mine_loc_bringup.main:main"]},
)
