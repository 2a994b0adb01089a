from setuptools import find_packages, setup

setup(
    name="mine_loc_fusion",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_fusion": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_fusion"]),
        ("share/mine_loc_fusion", ["package.xml"]),
    ],
    description="Time alignment and fusion: one pose per person.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
