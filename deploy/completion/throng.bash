# Completion for throng, throng-view, throng-server, throng-render and throng-bake: asks the programs themselves
# (--help), so it never falls behind them. Source it, or put it into /etc/bash_completion.d.

_throng() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} program=$1 help sub i
  help=$("$program" --help 2>/dev/null) || return
  local subs
  subs=$(awk '/^Subcommands:/ {on = 1; next} on && /^  [a-z]/ {print $1} on && /^[^ ]/ {exit}' <<<"$help")
  for ((i = 1; i < COMP_CWORD; ++i)); do
    if grep -qxF -- "${COMP_WORDS[i]}" <<<"$subs"; then sub=${COMP_WORDS[i]}; fi
  done
  [ -z "$sub" ] || help+=$'\n'$("$program" "$sub" --help 2>/dev/null)

  COMPREPLY=()
  if [[ $before == -* ]]; then
    # an option that is one of a few words: "--raster TEXT:{auto,gl,visibility}=auto"
    local words
    words=$(grep -E -- "(^|[ ,])$before[ ,]" <<<"$help" | sed -n 's/.*:{\([^}]*\)}.*/\1/p' | head -n 1)
    if [ -n "$words" ]; then
      mapfile -t COMPREPLY < <(compgen -W "${words//,/ }" -- "$word")
      return
    fi
  fi
  if [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '^  -[^ ]+' <<<"$help" | tr ', ' '\n\n')" -- "$word")
  elif [ -n "$subs" ] && [ -z "$sub" ]; then
    mapfile -t COMPREPLY < <(compgen -W "$subs" -- "$word")
  fi
}
complete -o default -F _throng throng throng-server throng-render throng-bake throng-view
