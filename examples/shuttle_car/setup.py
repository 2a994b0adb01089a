from setuptools import find_packages, setup

setup(
    name="shuttle_car",
    version="0.1.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/shuttle_car"]),
        ("share/shuttle_car", ["package.xml"]),
    ],
    description="Example: a shuttle car that slows and stops for people, in Python.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["speed_guard = shuttle_car.speed_guard:main"]},
)
