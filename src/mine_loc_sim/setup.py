from setuptools import find_packages, setup

setup(
    name="mine_loc_sim",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_sim": ["py.typed", "range_law_industrial.npz"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_sim"]),
        ("share/mine_loc_sim", ["package.xml"]),
    ],
    description="A mine to test in: channel, walkers, emulators that speak bytes.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
