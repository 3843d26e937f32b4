
function __fish_motionseq_marks
    for word in (commandline -opc)
        if string match -q -- '*.motion' $word
            motionseq complete-marks $word 2>/dev/null
            return
        end
    end
end

