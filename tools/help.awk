# Prints the targets of a Makefile: groups from `##@ name`, targets from `name: ... ## what it does`.
/^##@ / { printf "\n%s\n", substr($0, 5) }
/^[a-z][a-z-]*:.*## / {
    target = $0; sub(/:.*/, "", target)
    note = $0; sub(/.*## /, "", note)
    printf "  make %-14s %s\n", target, note
}
END { print "" }
