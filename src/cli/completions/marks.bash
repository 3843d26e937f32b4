# The marks of the script on the command line.
_motionseq_marks() {
    local word mark
    for word in "${COMP_WORDS[@]:1}"; do
        word="${word//[\\\"\']/}"
        [[ ${word} == *.motion && -f ${word} ]] || continue
        while IFS= read -r mark; do
            [[ ${mark} == "${1}"* ]] && COMPREPLY+=("${mark}")
        done < <("${COMP_WORDS[0]}" complete-marks "${word}" 2>/dev/null)
        return 0
    done
}

# Completes marks and scripts, and leaves everything else to the generated function.
_motionseq_complete() {
    local cur="${COMP_WORDS[COMP_CWORD]}" prev="${COMP_WORDS[COMP_CWORD-1]}" word command=""
    COMPREPLY=()
    # Bash splits --from=MARK into three words.
    [[ ${prev} == "=" ]] && prev="${COMP_WORDS[COMP_CWORD-2]}"
    [[ ${cur} == "=" ]] && cur=""
    case "${prev}" in
        --from|--to)
            _motionseq_marks "${cur}"
            return 0
            ;;
        @OPTIONS@)
            _motionseq "$1" "${cur}" "${prev}"
            return 0
            ;;
    esac
    for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
        case "${word}" in
            @COMMANDS@)
                command="${word}"
                break
                ;;
        esac
    done
    if [[ -n ${command} && ${cur} != -* ]]; then
        compopt -o filenames 2>/dev/null
        while IFS= read -r word; do
            COMPREPLY+=("${word}")
        done < <(compgen -f -X '!*.motion' -- "${cur}"; compgen -d -- "${cur}")
        return 0
    fi
    _motionseq "$@"
    # Options are offered only after a dash.
    if [[ ${cur} != -* ]]; then
        local all=("${COMPREPLY[@]}")
        COMPREPLY=()
        for word in "${all[@]}"; do
            [[ ${word} == -* ]] || COMPREPLY+=("${word}")
        done
    fi
}

