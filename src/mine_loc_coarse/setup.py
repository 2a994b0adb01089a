from setuptools import find_packages, setup

setup(
    name="mine_loc_coarse",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_coarse": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_coarse"]),
        ("share/mine_loc_coarse", ["package.xml"]),
    ],
    description="Coarse regions from direction-finding monitors.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
