"""What a run leaves behind: the run file, its scores, its report; and the loop that makes one."""
