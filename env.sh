# Puts ROS 2, the built workspace and the `mine-loc` command on PATH:  . ./env.sh
# Everything ROS and its libraries write stays under build/.
_mine_loc_root=$(cd "$(dirname "${BASH_SOURCE[0]:-$0}")" && pwd)
. "$_mine_loc_root/.venv/bin/activate"
. "$_mine_loc_root/ros_ws/install/local_setup.bash"
export PATH="$_mine_loc_root/ros_ws/install/mine_loc_bringup/lib/mine_loc_bringup:$PATH"
export ROS_LOG_DIR="$_mine_loc_root/build/log" MPLCONFIGDIR="$_mine_loc_root/build/matplotlib"
export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
unset _mine_loc_root
