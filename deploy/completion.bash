# Completion of Subworld's commands, options, values and scenes. Rows follow, which the programs print: --completion.
# A key is what stands before a word, or an option and "=": the words that may follow. ":scene" is a positional argument.
declare -gA _subworld_words
_subworld() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} path=${COMP_WORDS[0]##*/} index words scenes
  for ((index = 1; index < COMP_CWORD; ++index)); do
    [[ -v _subworld_words["$path ${COMP_WORDS[index]}"] ]] || break
    path+=" ${COMP_WORDS[index]}"
  done
  words=${_subworld_words["$path $before="]-${_subworld_words["$path"]-}}
  if [[ $words == *:scene* ]]; then
    scenes=$(dirname "$(readlink -f "$(type -P "${COMP_WORDS[0]}")")")/../../share/subworld/scenes
    words+=" $(cd "$scenes" 2>/dev/null && printf '%s ' *.yaml)"
    words=${words//.yaml/}
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -X ":*" -- "$word")
}
complete -o default -F _subworld subworld world_sim haptic_sim device_sim gui_headless
