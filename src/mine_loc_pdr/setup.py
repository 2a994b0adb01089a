from setuptools import find_packages, setup

setup(
    name="mine_loc_pdr",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_pdr": ["py.typed", "models/*.npz"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_pdr"]),
        ("share/mine_loc_pdr", ["package.xml"]),
    ],
    description="FDILink, attitude, steps, stride: pedestrian dead reckoning from a waist-worn N100.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
