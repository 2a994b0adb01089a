from setuptools import find_packages, setup

setup(
    name="mine_loc_core",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_core": ["py.typed", "schema/*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_core"]),
        ("share/mine_loc_core", ["package.xml"]),
    ],
    description="What all of mine_loc shares",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
