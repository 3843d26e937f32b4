_motionseq_marks() {
    local script=${(Q)${words[(r)*.motion(|\"|\')]}}
    local -a marks
    [[ -n $script ]] && marks=(${(f)"$(_call_program marks motionseq complete-marks ${(q)script} 2>/dev/null)"})
    compadd -a marks
}

