from setuptools import find_packages, setup

setup(
    name="mine_loc_uwb",
    version="0.1.0",
    packages=find_packages(),
    package_data={"mine_loc_uwb": ["py.typed", "models/*.safetensors"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/mine_loc_uwb"]),
        ("share/mine_loc_uwb", ["package.xml"]),
    ],
    description="DWM1000 wire formats, range correction, position solving.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
