"""One module a sub-command of `mine-loc`; see mine_loc_bringup.main."""
